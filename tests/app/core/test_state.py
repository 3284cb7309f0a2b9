"""Window state: the core and the state of features."""

from dataclasses import dataclass, field, fields

from app.driver import make_state

import viewer
from viewer.app.core.state import AppState


@dataclass
class Notebook:
    pages: list[str] = field(default_factory=list)


def test_state_of_a_feature_is_created_once():
    state = make_state(viewer.load())
    state.of(Notebook).pages.append("one")
    assert state.of(Notebook).pages == ["one"]
    assert make_state(viewer.load()).of(Notebook).pages == []


def test_state_of_a_feature_can_be_replaced():
    state = make_state(viewer.load())
    first, other = state.of(Notebook), Notebook(["two"])
    assert state.put(other) is other and state.of(Notebook) is other is not first


def test_changing_the_active_actor_is_counted_and_deselects_the_joint():
    state = make_state(viewer.load())
    state.selected_joint, before = 1, state.n_choices
    state.choose_actor(0)
    assert state.n_choices == before + 1 and state.selected_joint == -1


def test_core_has_no_field_for_a_feature():
    assert len(fields(AppState)) <= 25
