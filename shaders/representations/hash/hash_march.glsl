// Samples and composites one content of a `hash` scene along a ray (docs/tile-format.md, section 7; NGP-RT, section 4.3).
// Must match src/representations/hash/cpu/hash_march.cpp and hash_features.cpp.
//
// Reads: domain_path.glsl, part_place.glsl; TABLES, the number of fine levels of a part; VARYING, defined if weights vary
//   with the position; SHARED, defined if one logit weights a whole level; the viewer's storage of a content:
//     struct Part               with place; texels, finest cells along an axis; lattice, corners along an axis; ratio: 0, 1, 2
//                               if coarse cells of distances are 1, 2 or 4 finest cells wide; ranges, an index of:
//     vec4 content[]            for each eight columns low and scale of columns 1 2 3 0 and low and scale of 4 5 6 7, for bytes
//                               divided by 255; then for each table its resolution, entries, whether it is hashed and a
//                               number for the viewer's use, and four such vectors for its undivided bytes
//     uint distanceWord(Part, ivec3 coarseCell), uint nearWord(Part, uint n)    of src/representations/hash/content/occupancy_distance.h
//     vec4 macroblockAt(Part, vec3 block)      of 9³ corners; w is 0 if there is none, xyz are for the viewer's use
//     vec4 cornersFirst(Part, int eight, vec4 macroblock, vec3 within), cornersSecond(...)    for each eight columns the
//                                              interpolated columns 1 2 3 0 and 4 5 6 7; `within` is 0 at the centre of the
//                                              first corner; the second is called right after the first
//     uvec2 entryAt(Part, int level, float number, uint entry)    the eight bytes of an entry; `number` is the viewer's
//   vec2 levelWeights[TABLES], unless VARYING: of density and of all else; float shares[TABLES + 1] or more: factors of the diffuse
//   colour and features of the coarse level and of each fine level, 1 except in display modes; int attention: the level l whose
//   weights of density (1 + 2 l) or of all else (2 + 2 l) replace the features, 0 for none; float stepLength: fraction of the
//   domain's width; float minTransmittance.
// Defines: marchSegment.

const float kLongestStep = 1e3;     // the largest step that counts, scene units
const float kMaxLogDensity = 15.0;
const float kCellSlack = 1e-3;      // finest cells: larger than the rounding errors of positions
const int kTableVectors = 5;

// Unpacks the bytes of an entry: diffuse colour and density, features.
void unpackEntry(uvec2 words, out vec4 first, out vec4 second) {
  first = vec4(uvec4(words.x >> 8, words.x >> 16, words.x >> 24, words.x) & 255u);
  second = vec4(uvec4(words.y, words.y >> 8, words.y >> 16, words.y >> 24) & 255u);
}

// Interpolates a fine level at p in [0,1]³ of the domain; its vectors in `content` begin at `at`.
void mixTable(Part part, int level, int at, vec3 p, out vec4 first, out vec4 second) {
  vec4 head = content[at];  // resolution, entries, hashed, the viewer's number
  vec3 scaled = (head.x - 1.0) * p + 0.5;
  vec3 lower = floor(scaled), upper = scaled - lower;
  uvec3 c = uvec3(lower);
  uint resolution = uint(head.x), entries = uint(head.y);
  // The terms of the lower and the upper sides in the index of an entry.
  uvec2 x = uvec2(c.x, c.x + 1u), y = uvec2(c.y, c.y + 1u), z = uvec2(c.z, c.z + 1u);
  bool hashed = head.z != 0.0;
  y *= hashed ? 2654435761u : resolution;
  z *= hashed ? 805459861u : resolution * resolution;
  first = vec4(0.0);
  second = vec4(0.0);
  for (int k = 0; k < 8; ++k) {
    int i = k & 1, j = (k >> 1) & 1, l = k >> 2;
    uint entry = hashed ? (x[i] ^ y[j] ^ z[l]) & (entries - 1u) : (x[i] + y[j] + z[l]) % entries;
    vec4 one, other;
    unpackEntry(entryAt(part, level, head.w, entry), one, other);
    float weight = (i == 1 ? upper.x : 1.0 - upper.x) * (j == 1 ? upper.y : 1.0 - upper.y) * (l == 1 ? upper.z : 1.0 - upper.z);
    first += weight * one;
    second += weight * other;
  }
  first = content[at + 1] + content[at + 2] * first;
  second = content[at + 3] + content[at + 4] * second;
}

#ifdef VARYING
// Returns a level's weights of density and of all else; the columns have the order 1 2 3 0, 4 5 6 7.
vec2 levelAttentionWeights(int level, vec4 first, vec4 second) {
#ifdef SHARED
  float logit = level < 4 ? first[(level + 3) & 3] : second[level & 3];
  vec2 logits = vec2(logit);
#else
  vec2 logits = level == 0 ? first.wx : level == 1 ? first.yz : level == 2 ? second.xy : second.zw;
#endif
  return 1.0 / (1.0 + exp(-logits));
}
#endif

// Computes the features at p within a macroblock; `first` is diffuse colour and log-density, before any activation.
void featuresAt(Part part, vec3 p, vec4 macroblock, vec3 within, out vec4 first, out vec4 second) {
  int ranges = part.ranges;
  vec4 coarse = content[ranges] + content[ranges + 1] * cornersFirst(part, 0, macroblock, within);
  vec4 coarseFeatures = content[ranges + 2] + content[ranges + 3] * cornersSecond(part, 0, macroblock, within);
  first = vec4(shares[0] * coarse.rgb, coarse.a);
  second = shares[0] * coarseFeatures;
#ifdef VARYING
  vec4 logitsFirst = content[ranges + 4] + content[ranges + 5] * cornersFirst(part, 1, macroblock, within);
  vec4 logitsSecond = content[ranges + 6] + content[ranges + 7] * cornersSecond(part, 1, macroblock, within);
  int table = ranges + 8;
#else
  int table = ranges + 4;
#endif
  float shown = 0.0;
  for (int level = 0; level < TABLES; ++level, table += kTableVectors) {
#ifdef VARYING
    vec2 weights = levelAttentionWeights(level, logitsFirst, logitsSecond);
#else
    vec2 weights = levelWeights[level];
#endif
    vec4 fine, fineFeatures;
    mixTable(part, level, table, p, fine, fineFeatures);
    float share = shares[level + 1] * weights.y;
    first += vec4(vec3(share), weights.x) * fine;
    second += share * fineFeatures;
    if (attention == 1 + 2 * level) shown = weights.x;
    if (attention == 2 + 2 * level) shown = weights.y;
  }
  if (attention > 0) second.rgb = vec3(shown);
}

void marchSegment(Part part, DomainSegment s, inout Composite sum) {
  float cells = part.texels;
  float step = stepLength * cells;
  vec3 up = vec3(greaterThan(s.direction, vec3(0.0)));
  vec3 inverse = mix(1.0 / s.direction, vec3(-1e20), equal(s.direction, vec3(0.0)));  // negative, as such directions belong to the lower octant
  uint shift = 4u * uint(up.x + 2.0 * up.y + 4.0 * up.z);
  float count = ceil(s.whole / step);
  float i = 0.0;
  int guard = 0;  // a bound for drivers that require one; no segment is longer than the diagonal
  do {
    // Advances to a step that may not be empty, in a separate loop: when several rays are executed together (always in
    // Mesa on a CPU), all of them execute a loop's body until the last one has left the loop.
    float from, to, tau;
    vec3 x;
    do {
      from = i * step, to = min(from + step, s.whole);
      tau = 0.5 * (from + to);
      x = clamp(s.start + tau * s.direction, 0.0, cells * 0.9999999);
      ivec3 cell = ivec3(x);
      float edge = float(1 << part.ratio);  // of the cells in which empty space is measured
      uint word = distanceWord(part, cell >> part.ratio);
      if ((word & 15u) == 0u) {
        if (part.ratio == 0) break;
        ivec3 inside = cell & ((1 << part.ratio) - 1);
        uint n = ((word >> 4) << (3 * part.ratio)) + uint(inside.x + ((inside.y + (inside.z << part.ratio)) << part.ratio));
        word = nearWord(part, n);
        edge = 1.0;
      }
      float free = float((word >> shift) & 15u);
      if (free == 0.0) break;
      // A cube of `free` cells that begins here in the ray's octant is empty: advances to the first step whose middle lies
      // behind it.
      vec3 end = (floor(x / edge) + mix(vec3(1.0 - free), vec3(free), up)) * edge + mix(vec3(kCellSlack), vec3(-kCellSlack), up);
      vec3 exits = (end - s.start) * inverse;
      float exit = min(min(exits.x, exits.y), min(exits.z, s.whole));
      i = max(i + 1.0, ceil(exit / step - 0.5));
    } while (i < count && ++guard < 65536);
    if (i >= count) return;
    i += 1.0;
    vec3 p = x / cells;
    vec3 u = clamp(p * part.lattice - 0.5, 0.0, part.lattice - 1.0);
    vec3 block = floor(u / 8.0);
    vec4 macroblock = macroblockAt(part, block);
    if (macroblock.w != 0.0) {
      vec4 first, second;
      featuresAt(part, p, macroblock, u - 8.0 * block, first, second);
      float opacity = computeOpacity(exp(min(first.a, kMaxLogDensity)) * min(distanceBetween(s, from, to), kLongestStep));
      addTo(sum, first.rgb, second, opacity, distanceAt(s, tau));
    }
  } while (i < count && sum.transmittance >= minTransmittance && ++guard < 65536);
}
