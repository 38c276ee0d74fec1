// One content of a `volume` scene along a ray: its samples, composited (docs/tile-format.md, section 6; City-on-Web,
// section 4.2). Twin of src/render/cpu/volume_march.cpp.
//
// Reads: domain_path.glsl, part_place.glsl; `content`, whose first vectors are those of its parts, 6 each (see partOf);
//   sampler2DArray planesFirst, planesSecond (diffuse and density; features): a part's three planes in its corner of
//   three layers; vec4 voxelsFirst(vec3), voxelsSecond(vec3): texels of an atlas of macroblocks of 9³, the middle of the
//   first at 0.5; sampler3D macroblocks: where they are in it, bytes, the fourth 0 where none is; sampler3D distances:
//   bytes; float featureRange, densityRange, stepsPerTexel, minTransmittance.
// Defines: Part, partOf, marchSegment.

struct Part {
  Place place;
  float texels;  // of a plane along an axis
  float voxels;  // along an axis
  float layer;   // of its first plane
  ivec3 macroblockOrigin, distanceOrigin;
};

Part partOf(int n) {
  vec4 a = content[6 * n], b = content[6 * n + 1], c = content[6 * n + 2], d = content[6 * n + 3];
  ivec3 macroblocks = ivec3(content[6 * n + 4].xyz), distances = ivec3(content[6 * n + 5].xyz);
  return Part(placeOf(a, b, c, d), b.w, a.w, d.w, macroblocks, distances);
}

void marchSegment(Part part, DomainSegment s, inout Composite sum) {
  float cells = part.texels / 8.0;
  float margin = part.texels * 9.5e-7;  // positions are rounded by less
  float stepLength = 1.0 / stepsPerTexel;
  float voxelsPerTexel = part.voxels / part.texels;
  vec3 inverse = sign(s.direction) / max(abs(s.direction), vec3(1e-20));
  inverse = mix(inverse, vec3(1e20), equal(s.direction, vec3(0.0)));
  float widest = float(textureSize(planesFirst, 0).x);
  float count = ceil(s.length * stepsPerTexel);
  float i = 0.0;
  int guard = 0;  // no segment is longer than its diagonal; a bound for drivers that want one
  do {
    // On to a step that may show something, in a loop of its own: what takes several rays together (Mesa on a processor:
    // always) does for all of them whatever stands in a loop that one has not left.
    float from, to, tau;
    vec3 x;
    do {
      from = i * stepLength, to = min(from + stepLength, s.length);
      tau = 0.5 * (from + to);
      x = s.start + tau * s.direction;
      vec3 cell = clamp(floor(x / 8.0), 0.0, cells - 1.0);
      float reach = floor(texelFetch(distances, part.distanceOrigin + ivec3(cell), 0).r * 255.0 + 0.5);
      if (reach == 0.0) break;
      // The cube of cells nearer than that is empty: on to the first step whose middle lies behind it.
      vec3 end = mix((cell - reach + 1.0) * 8.0 + margin, (cell + reach) * 8.0 - margin, greaterThan(inverse, vec3(0.0)));
      vec3 exits = (end - s.start) * inverse;
      float exit = min(min(exits.x, exits.y), min(exits.z, s.length));
      i = max(i + 1.0, ceil(exit * stepsPerTexel - 0.5));
    } while (i < count && ++guard < 65536);
    if (i >= count) return;
    i += 1.0;
    vec3 u = clamp(x * voxelsPerTexel - 0.5, 0.0, part.voxels - 1.0);
    vec3 block = floor(u / 8.0);
    vec4 place = texelFetch(macroblocks, part.macroblockOrigin + ivec3(block), 0);
    vec3 voxel = floor(place.xyz * 255.0 + 0.5) * 9.0 + (u - 8.0 * block) + 0.5;
    vec3 p = clamp(x, 0.5, part.texels - 0.5) / widest;
    float weight = 0.0, opacity = 0.0;
    vec4 first = vec4(0.0);
    if (place.w != 0.0) {
      first = voxelsFirst(voxel) + textureLod(planesFirst, vec3(p.yz, part.layer), 0.0) +
              textureLod(planesFirst, vec3(p.xz, part.layer + 1.0), 0.0) +
              textureLod(planesFirst, vec3(p.xy, part.layer + 2.0), 0.0);
      // A byte b of four sources stands for -R + 2R b / 255 each.
      float density = exp(min(densityRange * (2.0 * first.a - 4.0) - 1.0, 15.0));
      opacity = opacityOf(density * distanceBetween(s, from, to));
      weight = sum.transmittance * opacity;
    }
    if (weight >= 1e-6) {
      vec4 second = voxelsSecond(voxel) + textureLod(planesSecond, vec3(p.yz, part.layer), 0.0) +
                    textureLod(planesSecond, vec3(p.xz, part.layer + 1.0), 0.0) +
                    textureLod(planesSecond, vec3(p.xy, part.layer + 2.0), 0.0);
      addTo(sum, 1.0 / (1.0 + exp(featureRange * (4.0 - 2.0 * first.rgb))), 1.0 / (1.0 + exp(featureRange * (4.0 - 2.0 * second))),
            opacity, distanceAt(s, tau));
    }
  } while (i < count && sum.transmittance >= minTransmittance && ++guard < 65536);
}
