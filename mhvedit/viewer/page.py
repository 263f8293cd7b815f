"""The page that the browser shows: panels and buttons, bound to a web viewer."""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from trame.ui.vuetify3 import VAppLayout
from trame.widgets import client, html, vtk
from trame.widgets import vuetify3 as v3

from mhvedit.viewer.actions import KEYS, help_lines
from mhvedit.viewer.state import SPEEDS, CameraPreset, Layer

if TYPE_CHECKING:
    from mhvedit.viewer.web import WebViewer

BROWSER_KEYS = {
    "space": " ", "Left": "ArrowLeft", "Right": "ArrowRight", "bracketleft": "[", "bracketright": "]", "comma": ",",
    "period": ".", "minus": "-", "equal": "=",
}  # fmt: skip
ON_PICTURE = (
    "[$event.offsetX * $event.target.naturalWidth / $event.target.clientWidth, "
    "$event.offsetY * $event.target.naturalHeight / $event.target.clientHeight]"
)
TOLERANCES = (
    ("frames", "frames", 1),
    ("voxels", "voxels", 1),
    ("depth", "depth, m", 0.005),
    ("apart", "apart, m", 0.005),
)
PLAYHEAD = (
    "{ position: 'absolute', top: '10%', height: '66%', width: '3px', background: '#D55E00', pointerEvents: 'none', "
    "left: now + '%' }"
)
STYLE = """
html, body { overflow: hidden; }
.panel { min-height: 0; min-width: 0; }
.side { overflow-y: auto; padding: 6px 12px; }
.status div { font-size: 0.8rem; line-height: 1.25; }
.region { cursor: pointer; font-size: 0.8rem; }
.region:hover { background: #eef2f6; }
.gone { text-decoration: line-through; color: #8d939b; }
.hover { min-height: 2.4em; font-size: 0.8rem; color: #1f2933; padding: 0 8px; }
.keys { columns: 2; font-size: 0.85rem; }
.keys span:first-child { font-family: monospace; display: inline-block; width: 5.5em; }
"""


def build_page(viewer: "WebViewer") -> Callable[[], None]:
    """Lay the page out.

    Args:
        viewer: whose methods the buttons call.

    Returns:
        Sends the 3D view to the browser.
    """
    server = viewer.server
    server.state.trame__title = "mhvedit"
    server.state.help = False
    server.state.hover = ""
    server.controller.press = viewer.act
    with VAppLayout(server):
        client.Style(STYLE)
        _keys(viewer)
        with html.Div(style="display: grid; grid-template-rows: auto minmax(0, 1fr) auto; height: 100vh;"):
            _toolbar(viewer)
            with html.Div(
                classes="panel",
                style="display: grid; grid-template-columns: minmax(0, 1fr) 460px 300px;",
            ):
                with html.Div(classes="panel", style="position: relative; background: #f3f4f6;", id="scene"):
                    view = vtk.VtkRemoteView(
                        viewer.plotter.render_window, interactive_ratio=1, interactive_quality=80, still_quality=92
                    )
                    with html.Div(
                        classes="status",
                        id="status",
                        style="position: absolute; left: 8px; top: 8px; padding: 4px 8px; border-radius: 6px; "
                        "background: rgba(255,255,255,0.85); pointer-events: none;",
                    ):
                        html.Div("{{ line }}", v_for="line, i in status", key="i")
                _map(viewer)
                _side(viewer)
            _timeline(viewer)
        _help()
    return lambda: view.update()


def _keys(viewer: "WebViewer") -> None:
    """The same shortcuts as in the window; not while somebody types into a field."""
    actions = {BROWSER_KEYS.get(key, key): action for key, (action, _) in KEYS.items()}
    viewer.server.state.keys = actions
    viewer.server.trigger("pressed")(viewer.act)
    client.Script(_KEY_SCRIPT)


_KEY_SCRIPT = """
window.addEventListener('keydown', (event) => {
  if (['INPUT', 'TEXTAREA'].includes(event.target.tagName) || event.ctrlKey || event.metaKey || event.altKey) return;
  const state = window.trame.state;
  if (event.key === 'h') { state.set('help', !state.get('help')); return; }
  const action = state.get('keys')[event.key];
  if (action === undefined) return;
  event.preventDefault();
  window.trame.trigger('pressed', [action]);
});
"""


def _button(icon: str, name: str, words: str, click: Any, **more: Any) -> None:  # noqa: ANN401 - what trame takes
    with v3.VBtn(icon=True, density="comfortable", variant="text", id=name, title=words, click=click, **more):
        v3.VIcon(icon, size=20)


def _toolbar(viewer: "WebViewer") -> None:
    act = viewer.act
    with html.Div(
        style="display: flex; align-items: center; gap: 2px; padding: 2px 8px; border-bottom: 1px solid #d9dee3;"
    ):
        html.Div("{{ scene_name }}", style="font-weight: 600; margin-right: 10px;")
        with v3.VBtnToggle(
            model_value=("camera",), density="compact", divided=True, mandatory=True, style="height: 30px;",
            update_modelValue=(viewer.choose_camera, "[$event]"),
        ):  # fmt: skip
            for preset in CameraPreset:
                v3.VBtn(preset.value, value=preset.value, size="small", id=f"camera-{preset.name.lower()}")
        html.Div(style="width: 10px;")
        for layer in Layer:
            v3.VCheckboxBtn(
                label=layer.value, density="compact", id=f"layer-{layer.name.lower()}",
                model_value=(f"layers['{layer.value}']",),
                update_modelValue=(viewer.show_layer, f"['{layer.value}', $event]"), style="flex: none;",
            )  # fmt: skip
        _button("mdi-palette", "recolour", "volumes by end time or by label (t)", (act, "['recolour']"))
        v3.VSpacer()
        html.Div("{{ message }}", id="message", style="font-size: 0.8rem; color: #5f6b76; max-width: 30vw;")
        v3.VProgressLinear(
            v_if=("busy",), model_value=("share",), id="progress", color="primary", height=18, style="width: 180px;"
        )
        html.Div("{{ progress }}", v_if=("busy",), style="font-size: 0.75rem; margin: 0 6px;")
        _button("mdi-undo", "undo", "undo (z)", (act, "['undo']"), disabled=("!can_undo",))
        _button("mdi-redo", "redo", "redo (y)", (act, "['redo']"), disabled=("!can_redo",))
        v3.VBtn(
            "solve", id="solve", size="small", variant="tonal", title="solve again (s)", click=(act, "['solve']"),
            disabled=("busy || !unsolved",), color=("unsolved ? 'primary' : undefined",),
        )  # fmt: skip
        v3.VBtn(
            "save", id="save", size="small", variant="tonal", title="save into the scene file (w)",
            click=(act, "['save']"), disabled=("!unsaved",), color=("unsaved ? 'primary' : undefined",), classes="ml-1",
        )  # fmt: skip
        _button("mdi-help", "help", "keys (h)", "help = true")


def _map(viewer: "WebViewer") -> None:
    with html.Div(classes="panel", style="border-left: 1px solid #d9dee3; overflow-y: auto;"):
        html.Img(
            src=("map",), id="map", style="width: 100%; display: block; cursor: crosshair;", draggable=False,
            click=(viewer.click_map, ON_PICTURE), mousemove=(viewer.hover_map, ON_PICTURE),
            mouseleave=(viewer.hover_map, "[-1, -1]"),
        )  # fmt: skip
        html.Div("{{ hover }}", id="hover", classes="hover")


def _side(viewer: "WebViewer") -> None:
    act = viewer.act
    with html.Div(classes="panel side", style="border-left: 1px solid #d9dee3;"):
        html.Div("Segments", classes="text-subtitle-2")
        with html.Div(
            v_for="s in segments", key="s.name", classes="region", click=(viewer.choose_segment, "[s.name]"),
            style=("{ fontWeight: s.name === segment ? 700 : 400 }",),
        ):  # fmt: skip
            html.Span("{{ s.name }} &nbsp; {{ s.type }}")
        html.Div("Pose", classes="text-subtitle-2 mt-2")
        html.Div("{{ shown }}", id="shown", style="font-size: 0.8rem;")
        with html.Div():
            _button("mdi-rotate-left", "turn-left", "next facing that fits (,)", (act, "['turn left']"))
            _button("mdi-rotate-right", "turn-right", "next facing that fits (.)", (act, "['turn right']"))
            _button("mdi-pin", "pin", "pin what is shown (p)", (act, "['pin']"), disabled=("!can_decide",))
            _button("mdi-pin-off", "unpin", "take the pin away (shift p)", (act, "['unpin']"), disabled=("!pinned",))
            _button("mdi-selection-off", "exclude-near", "exclude what is near (shift x)", (act, "['exclude near']"))
            _button("mdi-close-box-outline", "exclude", "exclude this region (x)", (act, "['exclude region']"))
            _button("mdi-restore", "bring-back", "bring all back (r)", (act, "['bring back']"))
            _button("mdi-close", "no-preview", "no preview", (act, "['no preview']"), disabled=("!previewing",))
        html.Div("Regions of solutions", classes="text-subtitle-2 mt-2")
        with html.Div(
            v_for="r in regions", key="r.region", click=(viewer.choose_region, "[r.region]"),
            classes=("r.excluded ? 'region gone' : 'region'",), title="distance of B from A, most room",
        ):  # fmt: skip
            html.Span("{{ r.region }}: {{ r.count }} · {{ r.distance }} · {{ r.room }}")
        html.Div("Sight and tolerance", classes="text-subtitle-2 mt-2")
        v3.VTextField(
            label="cone half angle, degrees (empty: none)", id="half-angle", density="compact", hide_details=True,
            type="number", model_value=("half_angle",), disabled=("!can_decide",), change=(
                viewer.set_half_angle, "[$event.target.value]"), classes="mt-1",
        )  # fmt: skip
        for name, words, step in TOLERANCES:
            v3.VTextField(
                label=words, id=f"tolerance-{name}", density="compact", hide_details=True, type="number", step=step,
                min=0, model_value=(f"tolerance.{name}",), disabled=("!can_decide",),
                change=(viewer.set_tolerance, f"['{name}', $event.target.value]"), classes="mt-1",
            )  # fmt: skip


def _timeline(viewer: "WebViewer") -> None:
    act = viewer.act
    with html.Div(style="border-top: 1px solid #d9dee3;"):
        with html.Div(style="display: flex; align-items: center; padding: 0 8px;"):
            _button("mdi-skip-backward", "first", "first frame (home)", (act, "['first']"))
            _button("mdi-step-backward", "back", "one frame back", (act, "['back']"))
            with v3.VBtn(
                icon=True, density="comfortable", id="play", title="play, pause (space)", click=(act, "['play']")
            ):
                v3.VIcon(icon=("playing ? 'mdi-pause' : 'mdi-play'",), size=20)
            _button("mdi-step-forward", "ahead", "one frame ahead", (act, "['ahead']"))
            _button("mdi-skip-forward", "last", "last frame (end)", (act, "['last']"))
            v3.VSlider(
                model_value=("frame",), min=0, max=("n_frames - 1",), step=1, hide_details=True, density="compact",
                id="slider", update_modelValue=(viewer.go_to, "[$event]"), classes="mx-3",
            )  # fmt: skip
            html.Div("{{ frame }}", id="frame", style="width: 3.5em; text-align: right;")
            v3.VSelect(
                model_value=("speed",), items=("speeds", list(SPEEDS)), density="compact", hide_details=True,
                id="speed", update_modelValue=(viewer.set_speed, "[$event]"), style="max-width: 90px;", classes="mx-2",
            )  # fmt: skip
            v3.VCheckboxBtn(
                label="loop",
                model_value=("loop",),
                update_modelValue=(viewer.set_loop, "[$event]"),
                style="flex: none;",
            )
        with html.Div(style="position: relative;"):
            html.Img(
                src=("timeline",), id="timeline", style="width: 100%; display: block; cursor: pointer;",
                draggable=False, click=(viewer.click_timeline, ON_PICTURE.split(",")[0] + "]"),
            )  # fmt: skip
            html.Div(id="now", style=(PLAYHEAD,))


def _help() -> None:
    with v3.VDialog(v_model=("help",), max_width=860), v3.VCard(title="Keys", id="help-card"), v3.VCardText():
        with html.Div(classes="keys"):
            for key, words in help_lines():
                with html.Div():
                    html.Span(key)
                    html.Span(words)
