"""Parts of scene files that are written by scripts."""


def sensor(fov: str, origin: str, target: str, size: int) -> str:
    """A pinhole camera with z up and a square film of 64 samples per pixel."""
    return f"""\
    <sensor type="perspective">
        <float name="fov" value="{fov}"/>
        <string name="fov_axis" value="x"/>
        <transform name="to_world">
            <lookat origin="{origin}" target="{target}" up="0, 0, 1"/>
        </transform>
        <film type="hdrfilm">
            <integer name="width" value="{size}"/>
            <integer name="height" value="{size}"/>
            <string name="pixel_format" value="rgb"/>
            <string name="component_format" value="float32"/>
            <rfilter type="box"/>
        </film>
        <sampler type="independent">
            <integer name="sample_count" value="64"/>
        </sampler>
    </sensor>
"""
