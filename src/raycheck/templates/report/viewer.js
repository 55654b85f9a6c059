"use strict";
(() => {
  const srgb = (x) => x <= 0.0031308 ? 12.92 * x : 1.055 * Math.pow(x, 1 / 2.4) - 0.055;
  const byte = (x) => Math.round(255 * srgb(Math.min(1, Math.max(0, x))));

  // Four bytes a pixel: three mantissas m and an exponent e, value m · 2^(e − 136).
  function decode(text) {
    const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    const pixels = new Float32Array(bytes.length / 4 * 3);
    for (let i = 0, k = 0; i < bytes.length; i += 4) {
      const scale = Math.pow(2, bytes[i + 3] - 136);
      for (let c = 0; c < 3; c++) pixels[k++] = bytes[i + c] * scale;
    }
    return pixels;
  }

  // z from −1 to 1 on the scale of colours.
  function ramp(stops, z) {
    const place = (Math.min(1, Math.max(-1, z)) + 1) / 2 * (stops.length - 1);
    const low = Math.min(Math.floor(place), stops.length - 2), part = place - low;
    return stops[low].map((x, c) => x + part * (stops[low + 1][c] - x));
  }

  function viewer(root) {
    const data = window.raycheck?.[root.dataset.viewer]?.viewer;
    if (!data) return;
    const { width, height } = data;
    const find = (name) => root.querySelector("." + name);
    const reference = { name: "reference", pixels: decode(data.reference), caption: "", command: "" };
    const sets = {};
    for (const kind of ["samples", "time"]) {
      sets[kind] = data[kind].map((one) => ({ ...one, pixels: decode(one.pixels) }));
    }
    const names = ["reference", ...data.samples.map((one) => one.name)];
    for (const which of ["a", "b"]) {
      for (const name of names) find(which).append(new Option(name, name));
      find(which).value = names[which === "a" ? 0 : 1];
    }
    const size = Math.max(2, Math.round(Math.min(width, height) / 8));
    const state = { flipped: false, x: Math.floor(width / 2), y: Math.floor(height / 2) };
    const picture = (kind, which) =>
      sets[kind].find((one) => one.name === find(which).value) || reference;

    function colours(one) {
      const factor = data.exposure * Math.pow(2, Number(find("exposure").value));
      const scale = Number(find("range").value) * data.mean, out = new Uint8ClampedArray(4 * width * height);
      for (let i = 0; i < width * height; i++) {
        const p = one.pixels, r = reference.pixels;
        let rgb;
        if (find("what").value === "picture") {
          rgb = [0, 1, 2].map((c) => byte(p[3 * i + c] * factor));
        } else {
          const off = (p[3 * i] + p[3 * i + 1] + p[3 * i + 2] - r[3 * i] - r[3 * i + 1] - r[3 * i + 2]) / 3;
          rgb = ramp(data.stops, off / scale);
        }
        out.set([...rgb, 255], 4 * i);
      }
      return out;
    }

    function crop(canvas, pixels, name) {
      canvas.width = canvas.height = size;
      const left = Math.min(width - size, Math.max(0, state.x - size / 2 | 0));
      const top = Math.min(height - size, Math.max(0, state.y - size / 2 | 0));
      canvas.getContext("2d").putImageData(new ImageData(pixels, width, height), -left, -top);
      canvas.setAttribute("aria-label", `${data.scene}, ${name}, rows ${top} to ${top + size - 1}, columns ${left} to ${left + size - 1}, enlarged`);
      return { left, top };
    }

    function draw() {
      const slider = find("by").value === "slider", errors = find("what").value === "error";
      find("flip").disabled = slider;
      find("exposure").disabled = errors;
      find("range").disabled = !errors;
      const stops = Number(find("exposure").value);
      root.querySelector("output").textContent = `${stops > 0 ? "+" : ""}${stops} stops`.replace("-", "−");
      for (const view of root.querySelectorAll(".view")) {
        const kind = view.dataset.kind, main = view.querySelector(".main");
        const [a, b] = [picture(kind, "a"), picture(kind, "b")], [left, right] = [colours(a), colours(b)];
        const split = Number(view.querySelector(".split").value), at = Math.round(split / 100 * width);
        const context = main.getContext("2d"), shown = state.flipped ? b : a;
        context.putImageData(new ImageData(slider || !state.flipped ? left : right, width, height), 0, 0);
        if (slider && at < width) {
          context.putImageData(new ImageData(right, width, height), 0, 0, at, 0, width - at, height);
        }
        view.querySelector(".split").hidden = !slider;
        const edge = view.querySelector(".edge");
        edge.hidden = !slider;
        edge.style.left = `${100 * at / width}%`;
        const what = errors ? "signed error of " : "";
        main.setAttribute("aria-label", `${data.scene}, ${what}` +
          (slider ? `${a.name} left and ${b.name} right of ${split} percent` : shown.name));
        const [first, second] = view.querySelectorAll(".crop");
        const { left: x, top: y } = crop(first, left, what + a.name);
        crop(second, right, what + b.name);
        Object.assign(view.querySelector(".frame").style, {
          left: `${100 * x / width}%`, top: `${100 * y / height}%`,
          width: `${100 * size / width}%`, height: `${100 * size / height}%`,
        });
        caption(view, slider ? [a, b] : [shown], errors);
      }
    }

    function caption(view, shown, errors) {
      const about = view.querySelector(".about");
      about.replaceChildren();
      for (const one of shown) {
        const line = document.createElement("div"), name = document.createElement("b");
        name.textContent = one.name;
        line.append(name, one.caption ? `: ${one.caption}` : "");
        if (one.command) {
          const code = document.createElement("code");
          code.textContent = one.command;
          line.append(document.createElement("br"), code);
        }
        about.append(line);
      }
      const legend = view.querySelector(".legend"), scale = find("range").selectedOptions[0].textContent.slice(1);
      legend.hidden = !errors;
      legend.querySelector(".low").textContent = `−${scale} of the mean`;
      legend.querySelector(".high").textContent = `+${scale}`;
      const colour = (stop) => `rgb(${stop.join(",")})`;
      legend.querySelector(".ramp").style.background = `linear-gradient(to right, ${data.stops.map(colour).join(",")})`;
    }

    function flip() {
      state.flipped = !state.flipped;
      draw();
    }

    for (const control of root.querySelectorAll(".controls select, .controls input, .split")) {
      control.addEventListener("input", draw);
    }
    find("flip").addEventListener("click", flip);
    for (const main of root.querySelectorAll(".main")) {
      main.addEventListener("pointerdown", (event) => {
        const box = main.getBoundingClientRect();
        state.x = Math.floor((event.clientX - box.left) / box.width * width);
        state.y = Math.floor((event.clientY - box.top) / box.height * height);
        draw();
      });
      main.addEventListener("keydown", (event) => {
        const step = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
        if (step) {
          state.x = Math.min(width - 1, Math.max(0, state.x + step[0]));
          state.y = Math.min(height - 1, Math.max(0, state.y + step[1]));
          draw();
        } else if (event.key === " ") {
          find("by").value = "flip";
          flip();
        } else {
          return;
        }
        event.preventDefault();
      });
    }
    draw();
  }

  document.querySelectorAll("[data-viewer]").forEach(viewer);
})();
