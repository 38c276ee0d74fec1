// Samples and composites one content of a `volume` scene along a ray (docs/tile-format.md, section 6; City-on-Web,
// section 4.2). Must match src/representations/volume/cpu/volume_march.cpp.
//
// Reads: domain_path.glsl, part_place.glsl; the viewer's storage of a content:
//     struct Part               with place; texels of a plane and voxels along an axis
//     float reachAt(Part, vec3 cell)           all cells of 8 texels nearer than this many cells are empty; 0 if none
//     vec4 macroblockAt(Part, vec3 block)      of 9³ voxels; w is 0 if there is none, xyz are for the viewer's use
//     vec4 voxelsFirst(Part, vec4 macroblock, vec3 within), voxelsSecond(...)    the interpolated voxels: diffuse colour
//                                              and density; features; bytes divided by 255. `within` is 0 at the
//                                              centre of the first voxel
//     vec4 planesFirst(Part, vec3 x), planesSecond(...)    the sum of the interpolated planes at x texels
//   float featureRange, densityRange, stepsPerTexel, minTransmittance.
// Defines: marchSegment.

void marchSegment(Part part, DomainSegment s, inout Composite sum) {
  float cells = part.texels / 8.0;
  float margin = part.texels * 9.5e-7;  // larger than the rounding errors of positions
  float stepLength = 1.0 / stepsPerTexel;
  float voxelsPerTexel = part.voxels / part.texels;
  vec3 inverse = sign(s.direction) / max(abs(s.direction), vec3(1e-20));
  inverse = mix(inverse, vec3(1e20), equal(s.direction, vec3(0.0)));
  float count = ceil(s.whole * stepsPerTexel);
  float i = 0.0;
  int guard = 0;  // a bound for drivers that require one; no segment is longer than the diagonal
  do {
    // Advances to a step that may not be empty, in a separate loop: when several rays are executed together (always in
    // Mesa on a CPU), all of them execute a loop's body until the last one has left the loop.
    float from, to, tau;
    vec3 x;
    do {
      from = i * stepLength, to = min(from + stepLength, s.whole);
      tau = 0.5 * (from + to);
      x = s.start + tau * s.direction;
      vec3 cell = clamp(floor(x / 8.0), 0.0, cells - 1.0);
      float reach = reachAt(part, cell);
      if (reach == 0.0) break;
      // All cells nearer than `reach` are empty: advances to the first step whose middle lies behind their cube.
      vec3 end = mix((cell - reach + 1.0) * 8.0 + margin, (cell + reach) * 8.0 - margin, greaterThan(inverse, vec3(0.0)));
      vec3 exits = (end - s.start) * inverse;
      float exit = min(min(exits.x, exits.y), min(exits.z, s.whole));
      i = max(i + 1.0, ceil(exit * stepsPerTexel - 0.5));
    } while (i < count && ++guard < 65536);
    if (i >= count) return;
    i += 1.0;
    vec3 u = clamp(x * voxelsPerTexel - 0.5, 0.0, part.voxels - 1.0);
    vec3 block = floor(u / 8.0);
    vec3 within = u - 8.0 * block;
    vec4 macroblock = macroblockAt(part, block);
    float weight = 0.0, opacity = 0.0;
    vec4 first = vec4(0.0);
    if (macroblock.w != 0.0) {
      first = voxelsFirst(part, macroblock, within) + planesFirst(part, x);
      // Each byte b of the four sources (voxels and planes) represents -R + 2R b / 255.
      float density = exp(min(densityRange * (2.0 * first.a - 4.0) - 1.0, 15.0));
      opacity = computeOpacity(density * distanceBetween(s, from, to));
      weight = sum.transmittance * opacity;
    }
    if (weight >= 1e-6) {
      vec4 second = voxelsSecond(part, macroblock, within) + planesSecond(part, x);
      addTo(sum, 1.0 / (1.0 + exp(featureRange * (4.0 - 2.0 * first.rgb))), 1.0 / (1.0 + exp(featureRange * (4.0 - 2.0 * second))),
            opacity, distanceAt(s, tau));
    }
  } while (i < count && sum.transmittance >= minTransmittance && ++guard < 65536);
}
