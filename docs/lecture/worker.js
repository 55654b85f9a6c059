"use strict";
// In a worker: renders samples with oneray and hands over the film. The first message has the program and the scenes;
// later ones may add a file.
let program = null, scenes = null;
onmessage = ({ data }) => {
  if (data.program) {
    [program, scenes] = [new WebAssembly.Module(data.program), data.scenes];
    return;
  }
  if (data.name) {
    scenes[data.name] = data.text;
    return;
  }
  const coder = new TextEncoder(), start = performance.now();
  const words = [data.scene, ...data.options, "--samples", `${data.first}:${data.count}`, "--seed", String(data.seed), "--film", "film", "--quiet"];
  let done;
  try {
    done = runOneray(program, words, (path) => (path in scenes ? coder.encode(scenes[path]) : null), data.mistake ?? 0);
  } catch (error) {
    done = { status: 70, errors: String(error), files: new Map() };
  }
  const film = done.files.get("film")?.slice() ?? null;
  postMessage({ job: data.job, status: done.status, errors: done.errors, film, seconds: (performance.now() - start) / 1000 }, film ? [film.buffer] : []);
};
