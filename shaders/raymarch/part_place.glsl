// Where a part of a content stands, where rays are in it, and what is added up along them. docs/tile-format.md, sections 4
// and 6.
//
// Defines: Place, placeOf, clipToBox, ownedRange, Composite, opacityOf, addTo.

struct Place {
  vec3 centre, scale;
  vec3 low, high;  // what the part owns
  bool contracted;
};

// As the first four vectors of a part have it; their fourth numbers are others, but for that of the third.
Place placeOf(vec4 centre, vec4 scale, vec4 lowAndContracted, vec4 high) {
  return Place(centre.xyz, scale.xyz, lowAndContracted.xyz, high.xyz, lowAndContracted.w != 0.0);
}

// Where the ray is in a box, within `range` (x: from, y: to); nothing where not x < y.
vec2 clipToBox(vec3 o, vec3 d, vec3 low, vec3 high, vec2 range) {
  vec3 safe = mix(d, vec3(1e-20), lessThan(abs(d), vec3(1e-20)));
  vec3 a = (low - o) / safe, b = (high - o) / safe;
  vec3 near = min(a, b), far = max(a, b);
  return vec2(max(max(range.x, near.x), max(near.y, near.z)), min(min(range.y, far.x), min(far.y, far.z)));
}

// And in what the part owns and in its domain.
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
  float median;  // the distance at which half is hidden; 0 before
};

// 1 - exp(-x), to a float's digits for small x too.
float opacityOf(float x) {
  return x < 0.01 ? x * (1.0 - x * (0.5 - x / 6.0)) : 1.0 - exp(-x);
}

// Adds a sample.
void addTo(inout Composite sum, vec3 diffuse, vec4 features, float opacity, float distance) {
  float weight = sum.transmittance * opacity;
  sum.diffuse += weight * diffuse;
  sum.features += weight * features;
  sum.depth += weight * distance;
  if (sum.transmittance >= 0.5 && sum.transmittance - weight < 0.5) sum.median = distance;
  sum.transmittance *= 1.0 - opacity;
}
