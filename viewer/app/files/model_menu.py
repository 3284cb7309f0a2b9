"""Menu of the body models that are installed or can be added, and their folder."""

from __future__ import annotations

from pathlib import Path

from imgui_bundle import imgui

from viewer.app.core.jobs import ThreadJob
from viewer.app.core.reasons import no_job_room
from viewer.app.core.state import AppState, shows_errors
from viewer.app.core.widgets import begin_menu, explain, menu_item, note_item
from viewer.app.files.file_choice import FileDialog, folder_of
from viewer.app.files.files import Files, open_files
from viewer.models import found_models, known_models, load_model_folder, save_model_folder
from viewer.models.download import ADDABLE, CATALOG, Publication, add_model
from viewer.phrases import counted, printable


def draw_model_menu(state: AppState) -> None:
    """Draw the menu's items, searching when it opens."""
    files = state.of(Files)
    if imgui.is_window_appearing():
        files.models = found_models()
    for name, path in files.models.items():
        if name == "anny":
            _draw_rigs(state, name, path)
            continue
        model = CATALOG.get(name.partition(":")[0])
        if imgui.menu_item(name, model.licence if model else "", False)[0]:
            open_files(state, [path])
        note_item(state, name)
        explain(printable(path, 200))
    if not files.models:
        imgui.text_disabled("none found: choose the folder that contains them")
    imgui.separator_text("Not found")
    kinds = {name.partition(":")[0] for name in files.models}
    for kind, missing in CATALOG.items():
        if kind not in kinds and kind != "body":
            _draw_missing(state, kind, missing)
    imgui.separator()
    if menu_item(state, "Choose model folder…"):
        ask_for_model_folder(state)


def _draw_rigs(state: AppState, name: str, path: Path) -> None:
    """Draw a submenu of a model's rigs."""
    from viewer.formats.anny import RIGS

    opened = begin_menu(state, name)
    note_item(state, name)
    explain(printable(path, 200))
    if opened:
        for rig, about in RIGS.items():
            if imgui.menu_item(rig, "", False)[0]:
                state.of(Files).rig = rig
                open_files(state, [path])
            note_item(state, f"rig {rig}")
            explain(about)
        imgui.end_menu()


def _draw_missing(state: AppState, kind: str, model: Publication) -> None:
    """Draw a model that was not found: where it is published, or the item that adds it."""
    if kind in ADDABLE:
        label, why = f"Add {model.title}…", no_job_room(state)
        if imgui.menu_item(label, model.licence, False, not why)[0]:

            def add() -> list[str]:
                name, where = add_model(kind).name, f"File > Models > {kind}"
                return [f"{model.title} was added: open it with {where} ({name})"]

            state.job = ThreadJob(f"Downloading {model.title}", add, output="download")
        note_item(state, label)
        explain(f"{model.about}; downloaded with pip into your data folder", why)
        return
    imgui.menu_item(f"{model.title}##missing", model.licence, False, False)
    note_item(state, f"missing {kind}")
    explain("", f"{model.about}; published at {model.address}")


def ask_for_model_folder(state: AppState) -> None:
    """Ask for the folder of body models."""
    start = load_model_folder() or folder_of(state.paths)
    dialog = FileDialog(start, set_model_folder, "folder", "Folder of body models")
    state.of(Files).dialog = dialog


@shows_errors
def set_model_folder(state: AppState, paths: list[Path]) -> None:
    """Remember the first path as the folder of body models, and show how many it contains."""
    folder = save_model_folder(paths[0])
    state.of(Files).model_folder = folder
    count = len(known_models(folder))
    state.say(f"{counted(count, 'body model')} in {printable(folder, 200)}")
