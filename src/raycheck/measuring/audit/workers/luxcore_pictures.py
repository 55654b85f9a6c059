"""LuxCore by the module pyluxcore: the scene is its SDL, lines of the scene and of the configuration. It
looks about once a second whether it has the samples, so that there may be many more. One high picture is
divided into as many as there are seeds.
"""

import json
import os
import sys
import time


def main() -> None:
    job = json.load(sys.stdin)
    import numpy as np
    import pyluxcore as lux

    def properties(lines: list[str]) -> lux.Properties:
        made = lux.Properties()
        made.SetFromString("\n".join(lines))
        return made

    lux.Init(lambda line: None)
    lines = [line.strip() for line in job["scene"].splitlines() if line.strip()]
    scene = lux.Scene()
    scene.Parse(properties([line for line in lines if line.startswith("scene.")]))
    said = [line for line in lines if not line.startswith("scene.")]
    more = ["renderengine.seed = 1", f"batch.haltspp = {job['samples']}"]
    session = lux.RenderSession(lux.RenderConfig(properties(said + more), scene))
    session.Start()
    while not session.HasDone():
        time.sleep(0.02)
        session.UpdateStats()
    session.Stop()
    film = session.GetFilm()
    pixels = np.zeros(film.GetWidth() * film.GetHeight() * 3, dtype=np.float32)
    film.GetOutputFloat(lux.FilmOutputType.RGB, pixels)
    shaped = pixels.reshape(film.GetHeight(), film.GetWidth(), 3)[::-1]
    pictures = [one.tolist() for one in np.split(shaped.astype(float), len(job["seeds"]))]
    print("\n" + json.dumps({"version": lux.Version(), "pictures": pictures}), flush=True)
    os._exit(0)  # its threads do not survive Python's own end


if __name__ == "__main__":
    main()
