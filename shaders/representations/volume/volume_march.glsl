// One content of a `volume` scene along a ray: its samples, composited (docs/tile-format.md, section 6; City-on-Web,
// section 4.2). Twin of src/representations/volume/cpu/volume_march.cpp.
//
// Reads: domain_path.glsl, part_place.glsl; how a viewer holds a content:
//     struct Part               with place; texels and voxels, of a plane and of the voxels along an axis
//     float reachAt(Part, vec3 cell)           how many cells of 8 texels nothing is near; 0 where something may be
//     vec4 macroblockAt(Part, vec3 block)      of 9³ voxels; the fourth is 0 where none is, the rest is the viewer's
//     vec4 voxelsFirst(Part, vec4 macroblock, vec3 within), voxelsSecond(...)    their mix, 0 at the middle of the first:
//                                              diffuse and density; features; in shares of 255
//     vec4 planesFirst(Part, vec3 x), planesSecond(...)    the three planes' mixes at x texels, added up
//   float featureRange, densityRange, stepsPerTexel, minTransmittance.
// Defines: marchSegment.

void marchSegment(Part part, DomainSegment s, inout Composite sum) {
  float cells = part.texels / 8.0;
  float margin = part.texels * 9.5e-7;  // positions are rounded by less
  float stepLength = 1.0 / stepsPerTexel;
  float voxelsPerTexel = part.voxels / part.texels;
  vec3 inverse = sign(s.direction) / max(abs(s.direction), vec3(1e-20));
  inverse = mix(inverse, vec3(1e20), equal(s.direction, vec3(0.0)));
  float count = ceil(s.whole * stepsPerTexel);
  float i = 0.0;
  int guard = 0;  // no segment is longer than its diagonal; a bound for drivers that want one
  do {
    // On to a step that may show something, in a loop of its own: what takes several rays together (Mesa on a processor:
    // always) does for all of them whatever stands in a loop that one has not left.
    float from, to, tau;
    vec3 x;
    do {
      from = i * stepLength, to = min(from + stepLength, s.whole);
      tau = 0.5 * (from + to);
      x = s.start + tau * s.direction;
      vec3 cell = clamp(floor(x / 8.0), 0.0, cells - 1.0);
      float reach = reachAt(part, cell);
      if (reach == 0.0) break;
      // The cube of cells nearer than that is empty: on to the first step whose middle lies behind it.
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
      // A byte b of four sources stands for -R + 2R b / 255 each.
      float density = exp(min(densityRange * (2.0 * first.a - 4.0) - 1.0, 15.0));
      opacity = opacityOf(density * distanceBetween(s, from, to));
      weight = sum.transmittance * opacity;
    }
    if (weight >= 1e-6) {
      vec4 second = voxelsSecond(part, macroblock, within) + planesSecond(part, x);
      addTo(sum, 1.0 / (1.0 + exp(featureRange * (4.0 - 2.0 * first.rgb))), 1.0 / (1.0 + exp(featureRange * (4.0 - 2.0 * second))),
            opacity, distanceAt(s, tau));
    }
  } while (i < count && sum.transmittance >= minTransmittance && ++guard < 65536);
}
