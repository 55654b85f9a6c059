"""What a scene file says, and what can be known of it without rendering.

In comes a name, a label such as furnace@depth=2, or a file of Mitsuba's XML with values for its parameters.
Out come the scene as numbers in world space, the files that it needs, its hash, copies that are changed or
moved, and which of oneray's techniques apply to it.

variants    a scene file with the values of its parameters, which a reference belongs to; the canonical scenes
document    the one reader and writer of the XML: defaults, parameters, references by id, includes, file
            names. All that looks into a scene file does so by it
plugins     what an element says, by oneray's tables of properties (plugins.json): all of it is asked for, or
            an error
coats       what a coat over a diffuse base sends back and lets through: fits and tables
textures    the one table of textures, and
materials   that of materials: by both the reader, export, its schema and code go
reader      shapes, materials, lights and camera in double precision
meshes      the triangles of the files that it names
export      all primitives as plain data, for a renderer without an XML parser: the schema is
            scene.schema.json
code        the same as text, C++ or Rust
content     what decides whether a technique applies: lights, materials, depth
techniques  the only table of technique names: the lecture's ids, oneray's options, when each applies
lecture     the lecture's argument for each technique, a sentence each
"""
