"use strict";
// The deformed states: triangles on a canvas, a path for each of the 256 colours.
(() => {
  const data = JSON.parse(document.getElementById("data").textContent);
  const at = (id) => document.getElementById(id);
  const decoded = (text, kind) => {
    const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    return new kind(bytes.buffer);
  };
  const points = decoded(data.points, Float32Array);
  const triangles = decoded(data.triangles, Uint32Array);
  const borders = decoded(data.borders, Uint32Array);
  const edges = decoded(data.edges, Uint32Array);
  const colours = decoded(data.colours, Uint8Array);
  const count = triangles.length / 3;
  const states = data.states.map((state) => ({
    ...state,
    displacement: decoded(state.displacement, Int16Array),
    fields: state.fields.map((field) => ({ ...field, values: decoded(field.values, Uint8Array) })),
    status: decoded(state.status, Uint8Array),
  }));
  const view = at("view"), slider = at("state"), chosen = at("component"), scale = at("scale"), common = at("common");
  const moved = new Float32Array(points.length);
  const bins = new Uint8Array(count);
  let timer = 0;

  const colour = (k) => `rgb(${colours[3 * k]},${colours[3 * k + 1]},${colours[3 * k + 2]})`;
  const digits = (value) => (value === 0 ? "0" : Number(value.toPrecision(4)).toString());

  const move = (state, factor) => {
    for (let k = 0; k < points.length; k += 1) moved[k] = points[k] + factor * state.unit * state.displacement[k];
  };

  // Lower left corner and size of all states, so that the cell stays where it is.
  const extent = (factor) => {
    let left = Infinity, right = -Infinity, low = Infinity, high = -Infinity;
    for (const state of states) {
      const by = factor * state.unit, u = state.displacement;
      for (let k = 0; k < points.length; k += 2) {
        const x = points[k] + by * u[k], y = points[k + 1] + by * u[k + 1];
        if (x < left) left = x;
        if (x > right) right = x;
        if (y < low) low = y;
        if (y > high) high = y;
      }
    }
    return { left, low, width: right - left, height: high - low };
  };
  let frame = extent(data.scale);

  const classify = (field, range) => {
    const [low, high] = range, step = (field.high - field.low) / 255;
    for (let k = 0; k < count; k += 1) {
      const value = field.low + step * field.values[k];
      bins[k] = Math.max(0, Math.min(255, Math.round((255 * (value - low)) / (high - low))));
    }
  };

  const draw = () => {
    const state = states[slider.value], component = Number(chosen.value), field = state.fields[component];
    const range = common.checked ? data.ranges[component] : [field.low, field.high];
    const ratio = window.devicePixelRatio || 1, margin = 6;
    const width = view.parentElement.clientWidth, most = Math.max(240, 0.62 * window.innerHeight);
    const size = Math.min((width - 2 * margin) / frame.width, most / frame.height);
    const height = size * frame.height + 2 * margin;
    view.style.height = `${height}px`;
    view.width = Math.round(width * ratio);
    view.height = Math.round(height * ratio);
    const context = view.getContext("2d");
    const x0 = 0.5 * (width - size * frame.width) - size * frame.left, y0 = height - margin + size * frame.low;
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    move(state, Number(scale.value));
    classify(field, range);
    const paths = new Map();
    const x = (node) => x0 + size * moved[2 * node], y = (node) => y0 - size * moved[2 * node + 1];
    for (let k = 0; k < count; k += 1) {
      if (!paths.has(bins[k])) paths.set(bins[k], new Path2D());
      const path = paths.get(bins[k]), a = triangles[3 * k], b = triangles[3 * k + 1], c = triangles[3 * k + 2];
      path.moveTo(x(a), y(a));
      path.lineTo(x(b), y(b));
      path.lineTo(x(c), y(c));
      path.closePath();
    }
    context.lineWidth = 0.7; // closes the seams that antialiasing leaves
    context.lineJoin = "round";
    for (const [bin, path] of paths) {
      context.fillStyle = context.strokeStyle = colour(bin);
      context.fill(path);
      context.stroke(path);
    }
    const lines = (list, wanted, style, thickness) => {
      context.beginPath();
      for (let k = 0; k < list.length; k += 2) {
        if (!wanted(k / 2)) continue;
        context.moveTo(x(list[k]), y(list[k]));
        context.lineTo(x(list[k + 1]), y(list[k + 1]));
      }
      context.strokeStyle = style;
      context.lineWidth = thickness;
      context.lineCap = "round";
      context.stroke();
    };
    lines(borders, () => true, "#000", 0.8);
    data.kinds.forEach((kind, k) => k && lines(edges, (edge) => state.status[edge] === k, kind.colour, kind.width));
    tell(state, range, component);
  };

  const tell = (state, range, component) => {
    const unit = data.unit ? ` ${data.unit}` : "";
    at("label").textContent = state.mark ? `${state.mark}: ${state.label}` : state.label;
    at("load").textContent = state.load;
    at("mean").textContent = `mean ${data.components[component]}: ${digits(state.stress[component])}${unit}`;
    at("nodes").textContent = edges.length
      ? `interface nodes: ${data.kinds.map((kind, k) => `${state.nodes[k]} ${kind.name}`).join(", ")}` : "";
    at("low").textContent = digits(range[0]);
    at("middle").textContent = `${data.components[component]}${unit}`;
    at("high").textContent = digits(range[1]);
    slider.setAttribute("aria-valuetext", state.label);
    mark(state.point);
  };

  // Rings on the curves at the point of this state.
  const mark = (point) => {
    if (point === null || typeof Bokeh === "undefined") return;
    for (const page of Bokeh.documents) {
      for (const source of page.all_models) {
        if (source.name !== "shown") continue;
        const [x, y] = source.tags;
        source.data = { x: [x[point]], y: [y[point]] };
      }
    }
  };

  const stop = () => {
    clearInterval(timer);
    timer = 0;
    at("play").textContent = "\u25B6";
  };
  const play = () => {
    if (timer) return stop();
    at("play").textContent = "\u25A0";
    timer = setInterval(() => {
      slider.value = (Number(slider.value) + 1) % states.length;
      draw();
    }, 250);
  };

  data.components.forEach((name, k) => chosen.add(new Option(name, k)));
  chosen.value = data.component;
  common.checked = data.common;
  states.forEach((state, k) => {
    if (!state.mark) return;
    const jump = document.createElement("button");
    jump.type = "button";
    jump.textContent = state.mark;
    jump.addEventListener("click", () => { stop(); slider.value = k; draw(); });
    at("marks").append(jump);
  });
  slider.max = states.length - 1;
  scale.value = data.scale;
  const bar = at("bar").getContext("2d");
  for (let k = 0; k < 256; k += 1) {
    bar.fillStyle = colour(k);
    bar.fillRect(k, 0, 1, 1);
  }
  if (edges.length) {
    for (const kind of data.kinds) {
      const entry = document.createElement("span"), line = document.createElement("i");
      line.style.borderTopColor = kind.colour;
      line.style.borderTopWidth = `${kind.width}px`;
      entry.append(line, kind.name);
      at("kinds").append(entry);
    }
  }
  slider.addEventListener("input", () => { stop(); draw(); });
  chosen.addEventListener("change", draw);
  common.addEventListener("change", draw);
  scale.addEventListener("change", () => { frame = extent(Number(scale.value)); draw(); });
  at("play").addEventListener("click", play);
  new ResizeObserver(draw).observe(view.parentElement);
  window.addEventListener("beforeprint", draw);
  // Bokeh makes its documents after the page is there.
  window.addEventListener("load", () => setTimeout(draw, 0));
  draw();
})();
