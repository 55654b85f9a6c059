"""Exact images of the scenes whose light can be written down.

In comes a scene as numbers. Out come exact pixel means (H, W, 3), W·sr⁻¹·m⁻², to 1e-9 of a pixel, NaN in
pixels that hold an edge or where a formula does not hold; None for a scene or depth without a formula.

forms             which scene has which formula; evaluates it
lamps             point lights, rectangles and balls over rectangles: Lambert's formula less shadows
lamp_grid         a thousand rectangles over a floor
outdoors          sky, sun and spot
mirrors           the method of images; metals by Fresnel
rough             rough and brushed metals under a sky and a lamp: microfacets by quadrature
glass             a pane of glass, a plate of mixed material
furnace           a ball in a closed sphere
solids            plates and balls: solid angles, shadows, edges and rims on the film
pixel_quadrature  means over the square of each pixel
store             those that take long to evaluate, kept in references/closed-forms under a version of the
                  formulas
"""
