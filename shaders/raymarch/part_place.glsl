// The placement of a part of a content, ray clipping, and compositing along rays (docs/tile-format.md, sections 4 and
// 6).
//
// Defines: Place, unpackPlace, clipToBox, ownedRange, Composite, computeOpacity, addTo.

struct Place {
  vec3 centre, scale;
  vec3 low, high;  // the box that the part owns
  bool contracted;
};

// Unpacks the first four vectors of a part. Of their fourth components, only that of the third vector belongs to the
// place.
Place unpackPlace(vec4 centre, vec4 scale, vec4 lowAndContracted, vec4 high) {
  return Place(centre.xyz, scale.xyz, lowAndContracted.xyz, high.xyz, lowAndContracted.w != 0.0);
}

// Returns the range of the ray in a box, within `range` (x: from, y: to); empty unless x < y.
vec2 clipToBox(vec3 o, vec3 d, vec3 low, vec3 high, vec2 range) {
  vec3 safe = mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));
  vec3 a = (low - o) / safe, b = (high - o) / safe;
  vec3 near = min(a, b), far = max(a, b);
  return vec2(max(max(range.x, near.x), max(near.y, near.z)), min(min(range.y, far.x), min(far.y, far.z)));
}

// Returns the range of the ray in the box that the part owns and in the part's domain, within `range`.
vec2 ownedRange(Place place, vec3 o, vec3 d, vec2 range) {
  vec3 low = place.low, high = place.high;
  if (!place.contracted) {
    low = max(low, place.centre - place.scale);
    high = min(high, place.centre + place.scale);
  }
  return clipToBox(o, d, low, high, range);
}

struct Composite {
  vec3 diffuse;   // Σ w c
  vec4 features;  // Σ w f
  float transmittance;
  float depth;   // Σ w t
  float median;  // the distance at which transmittance falls below 0.5; 0 before
};

// Returns 1 - exp(-x), with full precision also for small x.
float computeOpacity(float x) {
  return x < 0.01 ? x * (1.0 - x * (0.5 - x / 6.0)) : 1.0 - exp(-x);
}

// Composites a sample behind the sum.
void addTo(inout Composite sum, vec3 diffuse, vec4 features, float opacity, float distance) {
  float weight = sum.transmittance * opacity;
  sum.diffuse += weight * diffuse;
  sum.features += weight * features;
  sum.depth += weight * distance;
  if (sum.transmittance >= 0.5 && sum.transmittance - weight < 0.5) sum.median = distance;
  sum.transmittance *= 1.0 - opacity;
}
