"""Sliders of expressions that change materials."""

from formats.vrm.swinging import swinging


def test_expression_slider_changes_materials_in_the_image(drive, tmp_path):
    path = tmp_path / "ada.vrm"
    path.write_bytes(swinging(turn=False).glb())
    hand = drive(path, size=(1000, 700), samples=1)
    hand.show_panel("Shape")
    row = hand.state.actor.figure.blend_shapes.names.index("angry")

    def red_pixels():
        hand.step(3)
        red, green, blue = hand.scene_picture()[..., :3].astype(int).transpose(2, 0, 1)
        return int(((red > 150) & (green < 40) & (blue < 40)).sum())

    assert red_pixels() == 0
    hand.enter_value(f"coefficient {row}", "1")
    assert hand.state.actor.pose.shape_weights[row] == 1.0
    shown = red_pixels()  # the hat, which was blue before
    assert shown > 20
    hand.enter_value(f"coefficient {row}", "0")
    assert red_pixels() == 0
    hand.key("z", "ctrl")
    assert red_pixels() == shown
