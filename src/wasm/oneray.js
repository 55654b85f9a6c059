"use strict";
// Runs oneray.wasm where there is no system: the part of WASI (snapshot preview 1) that it asks for, files in memory.
// In a page, a worker, or by `node src/wasm/oneray.js build/wasm/oneray.wasm ARGUMENTS …`, where files are those
// below the working folder, and MISTAKE=3 makes a mistake.

// The program with these arguments. `read(path)` gives a file's bytes or null, by its path
// from the root, without the first slash. `mistake` is one that the build has switches for. Returns its exit status, what it said on
// standard output and error, and the files that it wrote, by path.
function runOneray(module, words, read, mistake = 0) {
  const OK = 0, BAD_FILE = 8, NO_ENTRY = 44, NO_SYSTEM = 52;
  const written = new Map(), open = new Map([[3, { folder: "/" }]]);
  const said = ["", "", ""], encoder = new TextEncoder(), decoder = new TextDecoder();
  const text = (bytes) => decoder.decode(bytes);
  let memory = null, next = 4;
  const view = () => new DataView(memory.buffer), bytes = (at, size) => new Uint8Array(memory.buffer, at, size);
  const put64 = (at, value) => view().setBigUint64(at, BigInt(value), true), put32 = (at, value) => view().setUint32(at, value, true);
  class Exit { constructor(status) { this.status = status; } }

  function putWords(list, table, room) {
    for (const one of list) {
      const coded = encoder.encode(one + "\0");
      put32(table, room);
      bytes(room, coded.length).set(coded);
      table += 4;
      room += coded.length;
    }
    return OK;
  }
  const sizes = (list, count, size) => (put32(count, list.length), put32(size, list.reduce((sum, one) => sum + encoder.encode(one).length + 1, 0)), OK);

  // The parts of a scattered read or write.
  function* parts(table, count) {
    for (let i = 0; i < count; i++) yield bytes(view().getUint32(table + 8 * i, true), view().getUint32(table + 8 * i + 4, true));
  }
  function append(file, part) {
    const end = file.at + part.length;
    if (end > file.data.length) {
      const larger = new Uint8Array(Math.max(end, 2 * file.data.length, 1 << 16));
      larger.set(file.data.subarray(0, file.size));
      file.data = larger;
    }
    file.data.set(part, file.at);
    file.at = end;
    file.size = Math.max(file.size, end);
  }
  const name = (at, size) => text(bytes(at, size)).replace(/^[./]*\//, "");
  function putStatus(at, kind, size) {
    bytes(at, 64).fill(0);
    view().setUint8(at + 16, kind);
    put64(at + 32, size);
    return OK;
  }
  const REGULAR = 4, FOLDER = 3, TERMINAL = 2;

  const system = {
    args_sizes_get: (count, size) => sizes(["oneray", ...words], count, size),
    args_get: (table, room) => putWords(["oneray", ...words], table, room),
    environ_sizes_get: (count, size) => sizes([], count, size),
    environ_get: () => OK,
    clock_time_get: (id, precision, at) => (put64(at, Math.round(performance.now() * 1e6)), OK),
    proc_exit: (status) => { throw new Exit(status); },
    fd_prestat_get: (fd, at) => {
      if (!open.get(fd)?.folder) return BAD_FILE;
      put32(at, 0);
      put32(at + 4, open.get(fd).folder.length);
      return OK;
    },
    fd_prestat_dir_name: (fd, at, size) => (bytes(at, size).set(encoder.encode(open.get(fd).folder)), OK),
    fd_fdstat_get: (fd, at) => {
      if (fd > 2 && !open.has(fd)) return BAD_FILE;
      bytes(at, 24).fill(0);
      view().setUint8(at, fd < 3 ? REGULAR : open.get(fd).folder ? FOLDER : REGULAR);
      put64(at + 8, "0x1fffffff");
      put64(at + 16, "0x1fffffff");
      return OK;
    },
    fd_filestat_get: (fd, at) => (fd < 3 ? putStatus(at, TERMINAL, 0) : putStatus(at, REGULAR, open.get(fd)?.size ?? 0)),
    path_filestat_get: (folder, flags, path, size, at) => {
      const found = read(name(path, size));
      return found ? putStatus(at, REGULAR, found.length) : NO_ENTRY;
    },
    path_open: (folder, flags, path, size, how, rights, inherited, modes, at) => {
      const CREATE = 1, CUT = 8, called = name(path, size);
      const data = how & CUT ? new Uint8Array(0) : read(called);
      if (!data && !(how & CREATE)) return NO_ENTRY;
      const file = { data: data ?? new Uint8Array(0), size: data?.length ?? 0, at: 0 };
      if (how & CREATE) written.set(called, file);
      open.set(next, file);
      put32(at, next++);
      return OK;
    },
    fd_read: (fd, table, count, at) => {
      const file = open.get(fd);
      if (!file?.data) return BAD_FILE;
      let sum = 0;
      for (const part of parts(table, count)) {
        const taken = file.data.subarray(file.at, Math.min(file.size, file.at + part.length));
        part.set(taken);
        file.at += taken.length;
        sum += taken.length;
      }
      put32(at, sum);
      return OK;
    },
    fd_write: (fd, table, count, at) => {
      let sum = 0;
      for (const part of parts(table, count)) {
        if (fd < 3) said[fd] += text(part.slice());
        else append(open.get(fd), part);
        sum += part.length;
      }
      put32(at, sum);
      return OK;
    },
    fd_seek: (fd, offset, from, at) => {
      const file = open.get(fd);
      if (!file?.data) return 70; // ESPIPE
      file.at = Number(offset) + [0, file.at, file.size][from];
      put64(at, file.at);
      return OK;
    },
    fd_close: (fd) => (open.delete(fd) ? OK : BAD_FILE),
  };
  // What it asks for beyond that fails as on a system that has none of it.
  const imports = Object.fromEntries(WebAssembly.Module.imports(module).map((one) => [one.name, system[one.name] ?? (() => NO_SYSTEM)]));
  const instance = new WebAssembly.Instance(module, { wasi_snapshot_preview1: imports });
  memory = instance.exports.memory;
  if (mistake) instance.exports.mistake(mistake);
  let status = 0;
  try {
    instance.exports._start();
  } catch (stopped) {
    if (!(stopped instanceof Exit)) throw stopped;
    status = stopped.status;
  }
  const files = new Map([...written].map(([path, file]) => [path, file.data.subarray(0, file.size)]));
  return { status, output: said[1], errors: said[2], files };
}

if (typeof process !== "undefined" && typeof require === "function" && require.main === module) {
  const fs = require("node:fs"), [program, ...words] = process.argv.slice(2), mistake = Number(process.env.MISTAKE ?? 0);
  const read = (path) => { try { return new Uint8Array(fs.readFileSync(path)); } catch { return null; } };
  const done = runOneray(new WebAssembly.Module(fs.readFileSync(program)), words, read, mistake);
  process.stdout.write(done.output);
  process.stderr.write(done.errors);
  for (const [path, data] of done.files) fs.writeFileSync(path, data);
  process.exitCode = done.status;
}
