// One content of a `volume` scene along a ray: its samples, composited (docs/tile-format.md, section 6; City-on-Web,
// section 4.2). Twin of src/render/cpu/volume_march.cpp.
//
// Reads: volume_path.glsl; PARTS, the number of parts; `content`, whose first 6 PARTS vectors are theirs (see partOf);
//   sampler2DArray planesFirst, planesSecond (diffuse and density; features): a part's three planes in its corner of
//   three layers; vec4 voxelFirst(vec3), voxelSecond(vec3): texels of an atlas of macroblocks of 9³, the middle of the
//   first at 0.5; sampler3D macroblocks: where they are in it, bytes, the fourth 0 where none is; sampler3D distances:
//   bytes; float featureRange, densityRange, stepsPerTexel, minTransmittance.
// Defines: Part, partOf, ownedRange, Composite, marchPart.

struct Part {
  vec3 centre, scale;
  vec3 low, high;  // what it owns
  bool contracted;
  float voxels, planes;  // texels along an axis
  float layer;           // of its first plane
  ivec3 macroblockOrigin, distanceOrigin;
};

Part partOf(int n) {
  vec4 a = content[6 * n], b = content[6 * n + 1], c = content[6 * n + 2], d = content[6 * n + 3];
  Part part;
  part.centre = a.xyz;
  part.voxels = a.w;
  part.scale = b.xyz;
  part.planes = b.w;
  part.low = c.xyz;
  part.contracted = c.w != 0.0;
  part.high = d.xyz;
  part.layer = d.w;
  part.macroblockOrigin = ivec3(content[6 * n + 4].xyz);
  part.distanceOrigin = ivec3(content[6 * n + 5].xyz);
  return part;
}

// Where the ray is in a box, within `range` (x: from, y: to); nothing where not x < y.
vec2 clipToBox(vec3 o, vec3 d, vec3 low, vec3 high, vec2 range) {
  vec3 safe = mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));
  vec3 a = (low - o) / safe, b = (high - o) / safe;
  vec3 near = min(a, b), far = max(a, b);
  return vec2(max(max(range.x, near.x), max(near.y, near.z)), min(min(range.y, far.x), min(far.y, far.z)));
}

// And in what the part owns and in its domain.
vec2 ownedRange(Part part, vec3 o, vec3 d, vec2 range) {
  vec3 low = part.low, high = part.high;
  if (!part.contracted) {
    low = max(low, part.centre - part.scale);
    high = min(high, part.centre + part.scale);
  }
  return clipToBox(o, d, low, high, range);
}

struct Composite {
  vec3 diffuse;   // Σ w c
  vec4 features;  // Σ w f
  float transmittance;
  float depth;   // Σ w t
  float median;  // the distance at which half is hidden; 0 before
};

// 1 - exp(-x), to a float's digits for small x too.
float opacityOf(float x) {
  return x < 0.01 ? x * (1.0 - x * (0.5 - x / 6.0)) : 1.0 - exp(-x);
}

void marchSegment(Part part, VolumeSegment s, inout Composite sum) {
  float cells = part.planes / 8.0;
  float margin = part.planes * 9.5e-7;  // positions are rounded by less
  float stepLength = 1.0 / stepsPerTexel;
  float voxelsPerTexel = part.voxels / part.planes;
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
    vec3 p = clamp(x, 0.5, part.planes - 0.5) / widest;
    float weight = 0.0, opacity = 0.0;
    vec4 first = vec4(0.0);
    if (place.w != 0.0) {
      first = voxelFirst(voxel) + textureLod(planesFirst, vec3(p.yz, part.layer), 0.0) +
              textureLod(planesFirst, vec3(p.xz, part.layer + 1.0), 0.0) +
              textureLod(planesFirst, vec3(p.xy, part.layer + 2.0), 0.0);
      // A byte b of four sources stands for -R + 2R b / 255 each.
      float density = exp(min(densityRange * (2.0 * first.a - 4.0) - 1.0, 15.0));
      opacity = opacityOf(density * distanceBetween(s, from, to));
      weight = sum.transmittance * opacity;
    }
    if (weight >= 1e-6) {
      vec4 second = voxelSecond(voxel) + textureLod(planesSecond, vec3(p.yz, part.layer), 0.0) +
                    textureLod(planesSecond, vec3(p.xz, part.layer + 1.0), 0.0) +
                    textureLod(planesSecond, vec3(p.xy, part.layer + 2.0), 0.0);
      sum.diffuse += weight / (1.0 + exp(featureRange * (4.0 - 2.0 * first.rgb)));
      sum.features += weight / (1.0 + exp(featureRange * (4.0 - 2.0 * second)));
      float distance = distanceAt(s, tau);
      sum.depth += weight * distance;
      if (sum.transmittance >= 0.5 && sum.transmittance - weight < 0.5) sum.median = distance;
      sum.transmittance *= 1.0 - opacity;
    }
  } while (i < count && sum.transmittance >= minTransmittance && ++guard < 65536);
}

// Goes on with `sum`, which holds the content's parts in front of this one.
void marchPart(Part part, vec3 origin, vec3 direction, vec2 range, inout Composite sum) {
  vec3 o = (origin - part.centre) / part.scale, d = direction / part.scale;
  float halfDomain = part.contracted ? 2.0 : 1.0;
  int region = part.contracted ? regionAt(o + range.x * d) : kCube;
  float t = range.x;
  int guard = 0;  // at most five regions; where rays run along the border of two, some more pieces of no length
  do {
    int next = region;
    float exit = part.contracted ? min(leaveRegion(o, d, region, next), range.y) : range.y;
    if (exit > t) {
      marchSegment(part, volumeSegment(o, d, region, t, exit, halfDomain, part.planes), sum);
      if (sum.transmittance < minTransmittance) return;
      t = exit;
    }
    region = next;
  } while (t < range.y && ++guard < 12);
}
