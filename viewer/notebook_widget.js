// The page of a scene in a frame of its own, so that neither page can read the other: they exchange
// numbers as messages, which anywidget keeps equal to the traits of the kernel's widget.

function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.sandbox = "allow-scripts";
  frame.title = "3D view";
  frame.style.cssText = `width:100%;height:${model.get("height")}px;border:0`;
  frame.srcdoc = model.get("_page");
  const numbers = (view) => new Float64Array(
    view.buffer.slice(view.byteOffset, view.byteOffset + view.byteLength));
  const names = ["time", "camera", "_selection"];
  let known = {}, isReady = false, posed = {};
  const send = (name, value) => {
    const message = { viewer: { [name.replace("_", "")]: value } };
    if (isReady) frame.contentWindow.postMessage(message, "*");
  };
  const changed = (name) => {
    const value = model.get(name);
    if (JSON.stringify(value) === JSON.stringify(known[name])) return;
    known[name] = value;
    send(name, value);
  };
  for (const name of names) model.on(`change:${name}`, () => changed(name));
  // Sends the poses that were set since the last time.
  const pose = () => {
    if (!isReady) return;
    const poses = {};
    for (const [index, { number, values }] of Object.entries(model.get("_poses"))) {
      if (posed[index] === number) continue;
      posed[index] = number;
      poses[index] = Object.fromEntries(
        Object.entries(values).map(([name, array]) => [name, numbers(array)]));
    }
    send("poses", poses);
  };
  model.on("change:_poses", pose);
  const receive = ({ source, data }) => {
    if (source !== frame.contentWindow || !data || !data.viewer) return;
    const { time, camera, selection, angles } = data.viewer;
    if (!isReady) {
      isReady = true;
      // Values that were set before the page was ready.
      if (Object.keys(model.get("camera")).length) send("camera", model.get("camera"));
      if (model.get("time") !== 0) send("time", model.get("time"));
      if (model.get("_selection").length) send("_selection", model.get("_selection"));
      pose();
      return;
    }
    known = { time, camera, _selection: selection };
    for (const name of names) model.set(name, known[name]);
    model.set("_angles", angles);
    model.save_changes();
  };
  window.addEventListener("message", receive);
  el.append(frame);
  return () => window.removeEventListener("message", receive);
}
export default { render };
