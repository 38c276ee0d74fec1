// Where a raster shows a direction.
// Reads: RasterArguments. Defines: findRasterPosition().

// Sets `position`, in pixels; returns false where the raster does not show the direction. Half a pixel along its border
// is left out.
bool findRasterPosition(RasterArguments raster, vec3 direction, out vec2 position) {
  vec3 x;
  for (uint row = 0; row < 3; ++row) {
    x[row] = dot(vec3(raster.rasterFromScene[3 * row], raster.rasterFromScene[3 * row + 1],
                      raster.rasterFromScene[3 * row + 2]), direction);
  }
  position = vec2(raster.focal[0], raster.focal[1]) * x.xy / x.z + vec2(raster.centre[0], raster.centre[1]);
  return x.z > 0 && all(greaterThanEqual(position, vec2(0.5))) &&
         all(lessThan(position, vec2(raster.width, raster.height) - 0.5));
}
