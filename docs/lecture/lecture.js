"use strict";
// The live pictures: oneray in two workers, one for A and one for B; films joined, drawn, and compared with the converged pictures.
(() => {
  const NAMES = ["A", "B"], RANGE = 0.3;
  const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  const percent = (x) => { const size = Math.abs(x) * 100; return `${x < 0 ? "−" : ""}${size >= 10 ? size.toFixed(0) : size.toPrecision(2)}\u00a0%`; };

  async function unpacked(id) {
    const text = document.getElementById(id).textContent, bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
    return new Response(new Blob([bytes]).stream().pipeThrough(new DecompressionStream("gzip"))).arrayBuffer();
  }

  // A picture of halves as numbers.
  function pictureOf({ width, height, data }) {
    const bytes = Uint8Array.from(atob(data), (c) => c.charCodeAt(0)), halves = new Uint16Array(bytes.buffer);
    const values = Float32Array.from(halves, (h) => {
      const exponent = h >> 10 & 31, fraction = h & 1023;
      return exponent ? 2 ** (exponent - 15) * (1 + fraction / 1024) : 2 ** -14 * fraction / 1024;
    });
    return { width, height, values };
  }

  let ready = null;
  const references = {}, jobs = new Map();
  let lastJob = 0;
  function start() {
    ready ??= (async () => {
      const [program, data] = await Promise.all([unpacked("program"), unpacked("data")]);
      const { scenes, references: kept } = JSON.parse(new TextDecoder().decode(data));
      for (const [name, one] of Object.entries(kept)) references[name] = pictureOf(one);
      const url = URL.createObjectURL(new Blob([document.getElementById("worker").textContent], { type: "text/javascript" }));
      return NAMES.map(() => {
        const worker = new Worker(url);
        worker.onmessage = ({ data: done }) => { jobs.get(done.job)(done); jobs.delete(done.job); };
        worker.postMessage({ program: program.slice(0), scenes });
        return worker;
      });
    })();
    return ready;
  }

  // What a worker makes of samples first … first + count - 1: status, errors, film, seconds.
  async function render(side, scene, options, first, count, seed, mistake) {
    const workers = await start(), job = ++lastJob;
    return new Promise((resolve) => {
      jobs.set(job, resolve);
      workers[side].postMessage({ job, scene: `${scene}.xml`, options, first, count, seed, mistake });
    });
  }

  // A film's layers: of each pixel and channel the samples' sum and squared deviations from their mean.
  function layersOf(film) {
    let at = 0;
    const line = () => { const end = film.indexOf(10, at), text = new TextDecoder().decode(film.subarray(at, end)); at = end + 1; return text; };
    line(); line();
    const [, , , , width, height, count] = line().split(" ").map(Number), layers = [];
    for (let k = 0; k < count; k++) {
      const samples = 2 ** Number(line().split(" ")[0]), size = 48 * width * height;
      layers.push({ samples, numbers: new Float64Array(film.slice(at, at + size).buffer) });
      at += size;
    }
    return { width, height, layers };
  }

  // Takes layers into a sum: mean and squared deviations of all samples so far (Chan, Golub, LeVeque 1979).
  function join(sum, { width, height, layers }) {
    sum ??= { width, height, n: 0, mean: new Float64Array(3 * width * height), square: new Float64Array(3 * width * height) };
    for (const { samples, numbers } of layers) {
      const all = sum.n + samples;
      for (let i = 0; i < width * height; i++) for (let c = 0; c < 3; c++) {
        const k = 3 * i + c, difference = numbers[6 * i + c] / samples - sum.mean[k];
        sum.mean[k] += difference * samples / all;
        sum.square[k] += numbers[6 * i + 3 + c] + difference * difference * sum.n * samples / all;
      }
      sum.n = all;
    }
    return sum;
  }

  const average = (values) => values.reduce((sum, x) => sum + x, 0) / values.length;

  // The pixels at a lamp's edge: how much of the lamp is in them is what they are noisy by, whatever the technique.
  function edges({ width, height, values }) {
    const whole = average(values), found = new Uint8Array(width * height);
    for (let y = 0; y < height; y++) for (let x = 0; x < width; x++) {
      let low = Infinity, high = 0;
      for (let v = Math.max(y - 1, 0); v <= Math.min(y + 1, height - 1); v++) for (let u = Math.max(x - 1, 0); u <= Math.min(x + 1, width - 1); u++) {
        const k = 3 * (v * width + u), light = (values[k] + values[k + 1] + values[k + 2]) / 3;
        [low, high] = [Math.min(low, light), Math.max(high, light)];
      }
      found[y * width + x] = high > 4 * whole && low < 0.8 * high;
    }
    return found;
  }

  // Over the mean of the converged picture: RMSE; the difference of the means and its standard error; the mean variance of a
  // sample, over the mean squared; and the tile of 8 × 8 that is off the most for its noise: by how much, and how many
  // standard errors that is. RMSE and variance are without edges.
  function figures(sum, reference) {
    const whole = average(reference.values), skip = reference.edges ??= edges(reference), tiles = new Map();
    let squares = 0, variance = 0, count = 0, difference = 0, noise = 0;
    for (let i = 0; i < sum.width * sum.height; i++) {
      const tile = `${Math.floor(i % sum.width / 8)},${Math.floor(i / sum.width / 8)}`, t = tiles.get(tile) ?? [0, 0, 0];
      for (let k = 3 * i; k < 3 * i + 3; k++) {
        const d = (sum.mean[k] - reference.values[k]) / whole, v = sum.n > 1 ? sum.square[k] / (sum.n - 1) / whole ** 2 : 0;
        t[0] += d;
        t[1] += v / sum.n;
        t[2] += 1;
        difference += d;
        noise += v / sum.n;
        if (!skip[i]) { squares += d * d; variance += v; count++; }
      }
      tiles.set(tile, t);
    }
    const n = sum.mean.length, channels = Math.sqrt(3); // three channels of a sample are off together
    let worst = { off: 0, times: 0 };
    for (const [d, v, k] of tiles.values()) {
      const one = { off: d / k, times: Math.abs(d) / (channels * Math.sqrt(v) + 1e-3 * k) };
      if (one.times > worst.times) worst = one;
    }
    return { rmse: Math.sqrt(squares / count), off: difference / n, variance: variance / count, error: channels * Math.sqrt(noise) / n, worst };
  }

  const encode = (x) => 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * Math.min(x, 1) ** (1 / 2.4) - 0.055);
  // The brightness that is shown as 0.8: that of the brightest twentieth, or lamps make all else black.
  const exposure = (values) => 0.8 / ([...values].sort((a, b) => a - b)[Math.floor(0.9 * values.length)] || 1);

  function paint(canvas, width, height, pixel) {
    [canvas.width, canvas.height] = [width, height];
    const context = canvas.getContext("2d"), image = context.createImageData(width, height);
    for (let i = 0; i < width * height; i++) image.data.set([...pixel(i), 255], 4 * i);
    context.putImageData(image, 0, 0);
  }
  const paintPicture = (canvas, { width, height, values }, scale) => paint(canvas, width, height, (i) => [0, 1, 2].map((c) => encode(scale * values[3 * i + c])));

  // From blue, too dark, over white to red, too bright; the three channels as one.
  function paintError(canvas, sum, reference) {
    const whole = average(reference.values), ends = [[33, 102, 172], [178, 24, 43]];
    paint(canvas, sum.width, sum.height, (i) => {
      let d = 0;
      for (let c = 0; c < 3; c++) d += (sum.mean[3 * i + c] - reference.values[3 * i + c]) / 3 / whole / RANGE;
      const end = ends[d > 0 ? 1 : 0], part = Math.min(Math.abs(d), 1);
      return end.map((x) => 247 + part * (x - 247));
    });
  }

  function draw(box, curves) {
    box.uplot?.destroy();
    box.replaceChildren();
    const xs = [...new Set(curves.flatMap((one) => one.map(([n]) => n)))].sort((a, b) => a - b);
    if (!xs.length) return;
    const ys = curves.flatMap((one) => one.map(([, y]) => y)), top = Math.max(...ys);
    const line = xs.map((n) => top * Math.sqrt(xs[0] / n) * 1.4), low = Math.min(...ys, ...line) / 1.3, high = Math.max(...ys, ...line) * 1.3;
    const tens = (a, b) => { const found = []; for (let k = -6; k <= 6; k++) for (const d of [1, 2, 5]) { const v = Number(`${d}e${k}`); if (v >= a && v <= b) found.push(v); } return found.length > 7 ? found.filter((v) => /^[1]/.test(v.toExponential())) : found; };
    const axis = (label, values) => ({ label, stroke: colour("faint"), grid: { stroke: colour("line"), width: 1 }, ticks: { show: false }, font: "12px system-ui", labelFont: "12px system-ui", labelSize: 18, ...values });
    const points = (name) => ({ show: true, size: 7, fill: colour(name), stroke: colour(name) });
    box.uplot = new uPlot({
      width: box.clientWidth, height: Math.max(272, Math.min(420, 0.75 * box.clientWidth)), legend: { show: false }, cursor: { show: false }, padding: [8, 14, 0, 0],
      scales: { x: { time: false, distr: 3, range: [Math.max(xs[0] / 1.3, 0.7), Math.max(xs.at(-1), 2) * 1.3] }, y: { distr: 3, range: [low, high] } },
      axes: [axis("samples per pixel", { size: 30, splits: () => xs, values: (_, all) => all.map(String), filter: (_, all) => all }),
        axis("RMSE over the mean", { size: 52, splits: (u, k, a, b) => tens(a, b), values: (_, all) => all.map(percent), filter: (_, all) => all })],
      series: [{}, { stroke: colour("faint"), width: 1, dash: [6, 4], points: { show: false } },
        ...NAMES.map((name, k) => ({ label: name, stroke: colour(name.toLowerCase()), width: 2, spanGaps: true, dash: k ? [9, 3] : undefined, points: points(name.toLowerCase()) }))],
    }, [xs, line, ...curves.map((one) => xs.map((n) => one.find(([m]) => m === n)?.[1] ?? null))], box);
  }

  // What A and B say of each other, in words.
  function compared([a, b]) {
    const says = [];
    const dark = (off) => `${percent(Math.abs(off))} too ${off > 0 ? "bright" : "dark"}`;
    const shifted = (one) => Math.abs(one.off) > Math.max(0.002, 4 * one.error), elsewhere = (one) => one.worst.times > 6 && Math.abs(one.worst.off) > 0.01;
    [a, b].forEach((one, k) => {
      if (shifted(one)) says.push(`${NAMES[k]} is ${dark(one.off)} on average (± ${percent(one.error)}). More samples do not help.`);
      else if (elsewhere(one)) says.push(`${NAMES[k]} is right on average, but not everywhere: a tile of 8 × 8 pixels is off by ${percent(Math.abs(one.worst.off))} of the picture's mean. More samples do not help.`);
    });
    if (says.length === 0 && a.variance > 0 && b.variance > 0) {
      const ratio = b.variance / a.variance, about = Number(ratio.toPrecision(2));
      const noise = ratio > 0.9 && ratio < 1.1 ? "A sample of B is about as noisy as one of A" : `A sample of B has ${about.toLocaleString("en")} times the variance of one of A`;
      says.push(`Neither differs from the converged picture by more than its noise. ${noise}; it took ${Number((b.pace / a.pace).toPrecision(2))} times as long, starting up included.`);
    }
    return says.join(" ");
  }

  let turn = 0; // one section renders at a time
  function setUp(box) {
    const ways = JSON.parse(box.dataset.ways), find = (name) => [...box.querySelectorAll(name)];
    const choice = find("select.way"), spp = box.querySelector(".spp"), seed = box.querySelector(".seed"), mistake = box.querySelector(".mistake");
    const told = find(".side .told"), pictures = find("canvas.picture"), errors = find("canvas.error"), plot = box.querySelector(".plot"), sum = box.querySelector(".sum");
    let curves = [[], []];
    const settings = () => ({ ways: choice.map((one) => ways[one.value]), spp: Number(spp.value), seed: Math.max(0, Math.floor(Number(seed.value) || 0)), mistake: Number(mistake?.value ?? 0) });
    const command = (way, { spp: n, seed: s }) => `build/oneray scenes/${way.scene}.xml ${way.options.join(" ")} --spp ${n} --seed ${s} -o picture.exr`;

    async function show() {
      await start();
      choice.forEach((one, k) => {
        const reference = references[ways[one.value].reference];
        paintPicture(pictures[k], reference, exposure(reference.values));
        paintError(errors[k], { ...reference, mean: reference.values }, reference);
      });
    }

    async function run() {
      const mine = ++turn, asked = settings(), totals = [null, null], last = [null, null];
      await start();
      if (mine !== turn) return;
      curves = [[], []];
      box.classList.add("drawn");
      box.querySelector(".commands").textContent = asked.ways.map((way, k) => `# ${NAMES[k]}: ${way.name}\n${command(way, asked)}`).join("\n");
      sum.textContent = "";
      await Promise.all(asked.ways.map(async (way, k) => {
        let seconds = 0;
        const reference = references[way.reference], scale = exposure(reference.values);
        for (let first = 0; first < asked.spp;) {
          const count = Math.min(first || 1, asked.spp - first);
          told[k].textContent = `${way.name}: ${first} of ${asked.spp} samples …`;
          const done = await render(k, way.scene, way.options, first, count, asked.seed, k ? asked.mistake : 0);
          if (mine !== turn) return;
          if (done.status) {
            told[k].textContent = `${way.name}: ${done.errors.trim()}`;
            return;
          }
          seconds += done.seconds;
          totals[k] = join(totals[k], layersOf(done.film));
          first += count;
          last[k] = { ...figures(totals[k], reference), pace: done.seconds / count };
          curves[k].push([totals[k].n, last[k].rmse]);
          paintPicture(pictures[k], { ...totals[k], values: totals[k].mean }, scale);
          paintError(errors[k], totals[k], reference);
          draw(plot, curves);
        }
        const name = k && asked.mistake ? `${way.name}, ${mistake.selectedOptions[0].textContent}` : way.name;
        told[k].textContent = `${name}: ${totals[k].n} sample${totals[k].n > 1 ? "s" : ""} in ${seconds.toFixed(seconds < 1 ? 2 : 1)} s, RMSE ${percent(last[k].rmse)}, mean ${last[k].off < 0 ? "" : "+"}${percent(last[k].off)}`;
        pictures[k].setAttribute("aria-label", `${NAMES[k]}: ${told[k].textContent}`);
      }));
      if (mine === turn && last[0] && last[1]) sum.textContent = compared(last);
      box.dataset.done = mine === turn ? String(Number(box.dataset.done ?? 0) + 1) : box.dataset.done ?? "0";
    }

    box.querySelector(".render").addEventListener("click", run);
    for (const one of [...choice, spp, seed, mistake]) one?.addEventListener("change", run);
    for (const button of box.parentElement.querySelectorAll("[data-mistake]")) {
      button.addEventListener("click", () => {
        choice.forEach((one) => { one.value = button.dataset.way; });
        mistake.value = button.dataset.mistake;
        box.scrollIntoView({ block: "nearest" });
        run();
      });
    }
    let seen = false;
    new IntersectionObserver((entries) => {
      if (!entries.some((one) => one.isIntersecting) || seen) return;
      seen = true;
      show().then(run);
    }, { rootMargin: "0px 0px -25% 0px" }).observe(box);
    return { show, redraw: () => curves.some((one) => one.length) && draw(plot, curves), seen: () => seen };
  }

  async function keep(canvas) {
    await start();
    const one = references[canvas.dataset.reference];
    paintPicture(canvas, one, exposure(one.values));
  }
  document.querySelectorAll("canvas.kept").forEach(keep);

  // The lecture's two pictures.
  async function head(box) {
    const ways = [["--estimator", "walk"], ["--estimator", "nee"]], canvases = box.querySelectorAll("canvas"), told = box.querySelectorAll(".told");
    await Promise.all(ways.map(async (options, k) => {
      const done = await render(k, "lecture", [...options, "--width", "160"], 0, 36, 0, 0);
      if (done.status) { told[k].textContent = done.errors; return; }
      const whole = join(null, layersOf(done.film));
      paintPicture(canvases[k], { ...whole, values: whole.mean }, exposure(references.lecture.values));
      told[k].textContent = `Rendered here in ${done.seconds.toFixed(1)} s.`;
    }));
    box.dataset.done = "1";
  }

  const lives = [...document.querySelectorAll("[data-section]")].map(setUp);
  const redraw = () => lives.forEach((one) => one.redraw());
  let width = innerWidth;
  addEventListener("resize", () => { if (innerWidth !== width) { width = innerWidth; redraw(); } });
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
  addEventListener("beforeprint", redraw);
  head(document.querySelector("[data-head]")).then(() => Promise.all(lives.map((one) => one.seen() || one.show())));

  // One section at a time.
  const sections = [...document.querySelectorAll("main > section")], button = document.getElementById("project");
  const at = () => Math.max(0, sections.findIndex((one) => `#${one.id}` === location.hash));
  function project(on, index = at()) {
    document.documentElement.classList.toggle("project", on);
    button.setAttribute("aria-pressed", on);
    sections.forEach((one, k) => one.classList.toggle("shown", on && k === index));
    if (on) { history.replaceState(null, "", `#${sections[index].id}`); scrollTo(0, 0); } else sections[index].scrollIntoView();
    redraw();
  }
  button.addEventListener("click", () => project(!document.documentElement.classList.contains("project")));
  addEventListener("keydown", (event) => {
    if (!document.documentElement.classList.contains("project") || /^(SELECT|INPUT|PRE)$/.test(event.target.tagName)) return;
    const step = { ArrowRight: 1, PageDown: 1, ArrowLeft: -1, PageUp: -1 }[event.key];
    if (step) { event.preventDefault(); project(true, Math.min(sections.length - 1, Math.max(0, at() + step))); }
    if (event.key === "Escape") project(false);
  });
  addEventListener("hashchange", () => { if (document.documentElement.classList.contains("project")) project(true); });
  // For who wants to render a scene of their own: lecture.add("mine.xml", text), then lecture.render(0, "mine", ["--estimator", "nee"], 0, 16, 0).
  window.lecture = { render, add: async (name, text) => (await start()).forEach((worker) => worker.postMessage({ name, text })) };
})();
