"use strict";
// Curves on logarithmic axes, drawn by uPlot: words at the lines, a marker for each colour, what a curve says under the pointer.
(() => {
  const COLOURS = ["open", "bad", "line-blue", "violet", "teal"];
  const UNITS = {
    seconds: (x) => x < 0.9e-3 ? `${number(x * 1e6)} µs` : x < 0.9 ? `${number(x * 1e3)} ms` : `${number(x)} s`,
    share: (x) => `${number(100 * x)} %`,
    count: (x) => number(x),
  };
  const number = (x) => Number(x.toPrecision(3)).toLocaleString("en", { maximumFractionDigits: 6 });
  const power = (x) => "10" + String(Math.round(Math.log10(x))).replace(/[-0-9]/g, (c) => "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"["-0123456789".indexOf(c)]);
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const own = (curve) => colour(curve.colour === null || curve.colour === undefined ? "grey" : COLOURS[curve.colour % COLOURS.length]);

  // Room beyond the data, no more: the axes fit them, and take in other lines that are near.
  function range(values, more) {
    const least = Math.min(...values), most = Math.max(...values);
    const part = Math.max(Math.pow(most / least, 0.4), 1.5), near = more.filter((one) => one > least / part && one < most * part);
    const [low, high] = [Math.min(least, ...near), Math.max(most, ...near)], room = Math.pow(high / low, 0.05) || 1;
    return [low / Math.max(room, 1.15), high * Math.max(room, 1.15)];
  }

  // Whole decades, of many every 2nd, 5th …; where there are few, 2 and 5 between them.
  function splits(low, high, most) {
    const first = Math.ceil(Math.log10(low) - 1e-9), last = Math.floor(Math.log10(high) + 1e-9), found = [];
    const step = [1, 2, 5, 10, 20, 50, 100, 200].find((one) => (last - first) / one < most);
    for (let n = first; n <= last; n++) if (n % step === 0) found.push(Math.pow(10, n));
    if (found.length > 2) return found;
    for (let n = first - 1; n <= last; n++) for (const digit of [2, 5]) found.push(digit * Math.pow(10, n));
    return found.filter((x) => x >= low && x <= high).sort((a, b) => a - b);
  }

  function marker(context, kind, x, y, size) {
    context.beginPath();
    if (kind === 0) context.arc(x, y, size, 0, 2 * Math.PI);
    else if (kind === 1) context.rect(x - size, y - size, 2 * size, 2 * size);
    else if (kind === 2) { context.moveTo(x, y - 1.3 * size); context.lineTo(x + 1.3 * size, y + size); context.lineTo(x - 1.3 * size, y + size); }
    else if (kind === 3) { context.moveTo(x, y - 1.4 * size); context.lineTo(x + 1.4 * size, y); context.lineTo(x, y + 1.4 * size); context.lineTo(x - 1.4 * size, y); }
    else { context.rect(x - 1.3 * size, y - 0.4 * size, 2.6 * size, 0.8 * size); context.rect(x - 0.4 * size, y - 1.3 * size, 0.8 * size, 2.6 * size); }
    context.fill();
  }

  // Heights for words, as near to the wanted ones as their distance allows.
  function spread(wanted, gap, low, high) {
    const order = wanted.map((y, i) => [y, i]).sort((a, b) => a[0] - b[0]), placed = [];
    let last = low - gap;
    for (const [y, i] of order) { last = Math.max(y, last + gap); placed[i] = last; }
    let next = high + gap;
    for (const [, i] of order.reverse()) { next = Math.min(placed[i], next - gap); placed[i] = next; }
    return placed;
  }

  function draw(box, spec) {
    box.plot?.destroy();
    box.replaceChildren();
    const curves = spec.curves.filter((one) => one.xs.length), words = curves.filter((one) => one.word ?? true);
    if (!curves.length) return;
    const xs = range(curves.flatMap((one) => one.xs), []);
    const ys = range(curves.flatMap((one) => one.ys), [spec.floor, spec.target].filter(Boolean));
    const tables = curves.flatMap((one) => [[one.xs, one.ys], ...(one.low ? [[one.xs, one.low], [one.xs, one.high]] : [])]);
    const place = [];
    let series = [{}], bands = [];
    for (const one of curves) {
      place.push(series.length);
      const stroke = own(one), grey = one.colour === null;
      series.push({ label: one.name, stroke, width: grey ? 1 : 1.8, dash: one.plain ? [6, 4] : undefined, spanGaps: true, points: { show: false } });
      if (one.low) {
        const none = { stroke: "transparent", spanGaps: true, points: { show: false } };
        series.push({ ...none, label: "" }, { ...none, label: "" });
        if (!grey) bands.push({ series: [series.length - 1, series.length - 2], fill: stroke + "2a" });
      }
    }
    const small = box.clientWidth < 380, size = small ? 11 : 12, font = `${size}px system-ui, sans-serif`;
    const ratio = devicePixelRatio, inner = `${size * ratio}px system-ui, sans-serif`;
    const measure = document.createElement("canvas").getContext("2d");
    measure.font = font;
    const room = words.length > 1 || spec.floor ? Math.min(Math.max(...words.map((one) => measure.measureText(one.name).width)) + 22, 0.36 * box.clientWidth) : 12;
    const unit = (which) => UNITS[spec.units?.[which]] ?? power;
    const axis = (which, low, high, most) => ({
      stroke: colour("faint"), font, labelFont: font, label: spec[which], labelGap: 0, gap: 4,
      size: which === "y" ? 58 : 34, labelSize: 20,
      grid: { stroke: colour("line"), width: 1 }, ticks: { show: false }, border: { show: true, stroke: colour("faint"), width: 1 },
      splits: () => splits(low, high, most), values: (_, all) => all.map(unit(which)), filter: (_, all) => all,
    });
    const told = document.createElement("div");
    told.className = "told";
    told.hidden = true;
    const state = { chosen: box.chosen ?? new Set(), hover: null };

    function over(u) {
      const context = u.ctx, x = (value) => u.valToPos(value, "x", true), y = (value) => u.valToPos(value, "y", true);
      const { left, top, width, height } = u.bbox;
      context.save();
      context.font = inner;
      const line = (value, text, dash) => {
        if (!value || value < ys[0] || value > ys[1]) return;
        context.strokeStyle = context.fillStyle = colour("faint");
        context.setLineDash(dash.map((part) => part * ratio));
        context.beginPath(); context.moveTo(left, y(value)); context.lineTo(left + width, y(value)); context.stroke();
        context.setLineDash([]);
        context.textAlign = "left"; context.textBaseline = "bottom";
        context.fillText(text, left + 5 * ratio, y(value) - 3 * ratio);
      };
      line(spec.target, "1 %", [1, 0]);
      line(spec.floor, "noise of the reference", [2, 3]);
      if (spec.slope) slope(context, u, left, top, width, height);
      curves.forEach((one) => {
        if (one.colour === null && !state.chosen.has(one.name)) return;
        if (one.plain) return;
        context.fillStyle = state.chosen.has(one.name) && one.colour === null ? colour("ink") : own(one);
        one.xs.forEach((value, k) => { if (one.ys[k]) marker(context, (one.colour ?? 0) % 5, x(value), y(one.ys[k]), 3.2 * ratio); });
      });
      const shown = curves.filter((one) => words.includes(one) || state.chosen.has(one.name));
      const ends = shown.map((one) => one.xs.length - 1);
      const at = spread(shown.map((one, k) => y(one.ys[ends[k]])), 1.25 * size * ratio, top + 4 * ratio, top + height - 4 * ratio);
      context.textAlign = "left"; context.textBaseline = "middle";
      if (room > 12) shown.forEach((one, k) => {
        context.fillStyle = context.strokeStyle = one.colour === null ? colour("ink") : own(one);
        context.globalAlpha = 0.5; context.setLineDash([ratio, 3 * ratio]);
        context.beginPath(); context.moveTo(x(one.xs[ends[k]]) + 4 * ratio, y(one.ys[ends[k]])); context.lineTo(left + width + 8 * ratio, at[k]); context.stroke();
        context.globalAlpha = 1; context.setLineDash([]);
        context.fillText(one.name, left + width + 11 * ratio, at[k], (room - 12) * ratio);
      });
      context.restore();
    }

    // A short line of slope −1/2 in the corner that falling curves leave empty, its word above it.
    function slope(context, u, left, top, width, height) {
      const perX = width / Math.log10(xs[1] / xs[0]), perY = height / Math.log10(ys[1] / ys[0]);
      const run = 0.22 * width, fall = run / perX / 2 * perY, text = "slope −½";
      const x1 = left + 0.06 * width, y2 = top + height - 0.07 * height, y1 = y2 - Math.min(fall, 0.5 * height);
      const length = Math.min(run, (y2 - y1) / perY * 2 * perX);
      context.strokeStyle = context.fillStyle = colour("faint");
      context.setLineDash([6 * ratio, 4 * ratio]); context.lineWidth = ratio;
      context.beginPath(); context.moveTo(x1, y1); context.lineTo(x1 + length, y2); context.stroke();
      context.setLineDash([]); context.textAlign = "left"; context.textBaseline = "bottom";
      context.fillText(text, x1 + length / 2 + 8 * ratio, (y1 + y2) / 2 - 2 * ratio);
    }

    // The nearest line within 30 pixels, and what it is there.
    function nearest(u) {
      const { left, top } = u.cursor;
      let best = { distance: 30 };
      if (left < 0) return best;
      for (const one of curves) {
        for (let k = 0; k < one.xs.length; k++) {
          const [ax, ay] = [u.valToPos(one.xs[k], "x"), u.valToPos(one.ys[k], "y")], end = Math.min(k + 1, one.xs.length - 1);
          const [bx, by] = [u.valToPos(one.xs[end], "x") - ax, u.valToPos(one.ys[end], "y") - ay];
          const part = bx || by ? Math.min(1, Math.max(0, ((left - ax) * bx + (top - ay) * by) / (bx * bx + by * by))) : 0;
          const distance = Math.hypot(left - ax - part * bx, top - ay - part * by);
          if (distance < best.distance) best = { distance, one, x: u.posToVal(ax + part * bx, "x"), y: u.posToVal(ay + part * by, "y"), left: ax + part * bx, top: ay + part * by };
        }
      }
      return best;
    }

    function point(u) {
      const { one, x, y, left, top } = nearest(u);
      told.hidden = !one;
      if (one) {
        const name = document.createElement("b"), where = document.createElement("div");
        name.textContent = one.name;
        const say = (which, value) => spec.units?.[which] ? UNITS[spec.units[which]](value) : value.toPrecision(3);
        where.textContent = `${say("y", y)} at ${say("x", x)}`;
        told.replaceChildren(name, one.told ? `: ${one.told}` : "", where);
        told.style.left = `${Math.max(0, Math.min(left, u.over.clientWidth - told.offsetWidth))}px`;
        told.style.top = `${Math.max(top - 58, 0)}px`;
      }
      if ((one?.name ?? null) !== state.hover) { state.hover = one?.name ?? null; emphasize(); }
    }

    function emphasize() {
      curves.forEach((one, k) => {
        const strong = state.chosen.has(one.name) || state.hover === one.name, line = box.plot.series[place[k]];
        line.width = strong ? 3.2 : one.colour === null ? 1 : 1.8;
        line._stroke = strong && one.colour === null ? colour("ink") : own(one);
        line.stroke = () => line._stroke;
      });
      box.plot.redraw(false);
    }

    box.plot = new uPlot({
      width: box.clientWidth, height: Math.round(Math.min(360, Math.max(240, 0.72 * box.clientWidth))),
      scales: { x: { time: false, distr: 3, range: xs }, y: { distr: 3, range: ys } },
      axes: [axis("x", ...xs, small ? 5 : 8), axis("y", ...ys, 8)], series, bands,
      padding: [10, room, 0, 0], legend: { show: false },
      cursor: { drag: { x: false, y: false }, points: { show: false }, x: false, y: false },
      hooks: { draw: [over], setCursor: [point] },
    }, uPlot.join(tables.map(([a, b]) => [a, b])), box);
    box.plot.over.append(told);
    box.plot.over.addEventListener("mouseleave", () => { told.hidden = true; state.hover = null; emphasize(); });
    box.choose = (name, on) => { on ? state.chosen.add(name) : state.chosen.delete(name); box.chosen = state.chosen; emphasize(); };
    if (state.chosen.size) emphasize();
  }

  // What the plot of a race shows of the contestants, by error and axis.
  function raced(data, choice, over) {
    const split = !(choice in data.curves[0].errors), kinds = split ? ["standard deviation", "bias"] : [choice];
    const curves = data.curves.filter((one) => !split || one.colour !== null).flatMap((one) => kinds.map((kind) => {
      const kept = one.spp.map((spp, k) => [spp, one.errors[kind][k]]).filter(([, error]) => error);
      const least = (k) => Math.max(kept[k][1][1], kept[k][1][0] / 10);
      return {
        name: split ? `${one.name}, ${kind === "bias" ? "bias" : "s.d."}` : one.name, colour: one.colour, told: one.told,
        word: one.colour !== null && kind !== "bias", plain: kind === "bias",
        xs: kept.map(([spp]) => over === "seconds" ? spp * one.seconds : spp), ys: kept.map(([, error]) => error[0]),
        low: kind === "bias" ? undefined : kept.map((_, k) => least(k)), high: kind === "bias" ? undefined : kept.map(([, error]) => error[2]),
      };
    }));
    return {
      x: over === "seconds" ? "process time" : "samples per pixel", y: split ? "error over the mean" : `${choice}${choice.startsWith("√") ? "" : " over the mean"}`,
      units: { x: over === "seconds" ? "seconds" : "count", y: "share" }, curves, slope: true,
      floor: choice.startsWith("RMSE") ? data.floor : 0, target: data.target,
    };
  }

  function races(root) {
    const data = window.raycheck?.[root.dataset.curves]?.races, choice = root.querySelector("select.metric");
    if (!data || !choice) return [];
    const boxes = [...root.querySelectorAll(".plot")];
    const show = () => boxes.forEach((box) => draw(box, raced(data, choice.value, box.dataset.over)));
    choice.addEventListener("input", show);
    for (const button of root.querySelectorAll("button.choose")) {
      button.addEventListener("click", () => {
        const on = button.getAttribute("aria-pressed") !== "true";
        button.setAttribute("aria-pressed", on);
        boxes.forEach((box) => box.choose?.(button.textContent, on));
      });
    }
    return [show];
  }

  const all = [...document.querySelectorAll("[data-curves]")].flatMap(races);
  for (const box of document.querySelectorAll("[data-plot]")) {
    const spec = window.raycheck?.[box.dataset.plot]?.plots?.[box.dataset.number];
    if (spec) all.push(() => draw(box, spec));
  }
  const show = () => all.forEach((one) => one());
  show();
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; show(); } });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", show);
  addEventListener("beforeprint", show);
  addEventListener("afterprint", show);
})();
