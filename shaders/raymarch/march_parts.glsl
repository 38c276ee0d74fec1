// A pixel's ray through a content.
// Reads: march_part.glsl; view.glsl; Part partOf(uint), Place placeOfPart(uint); float minTransmittance. Defines: marchContent().

// Through what the content owns of the ray, part after part in the order in which the ray enters them.
void marchParts(vec3 o, vec3 d, vec2 whole, uint partCount, inout Composite sum) {
  float entered = 0;  // the last one's entry and number
  uint last = 0;
  for (uint turn = 0; turn < partCount && sum.transmittance >= minTransmittance; ++turn) {
    uint nearest = partCount;
    vec2 range = vec2(0);
    for (uint n = 0; n < partCount; ++n) {
      const vec2 owned = ownedRange(placeOfPart(n), o, d, whole);
      if (!(owned.x < owned.y)) continue;
      if (turn > 0 && (owned.x < entered || (owned.x == entered && n <= last))) continue;
      if (nearest < partCount && owned.x >= range.x) continue;
      nearest = n;
      range = owned;
    }
    if (nearest == partCount) return;
    marchPart(partOf(nearest), o, d, range, sum);
    entered = range.x;
    last = nearest;
  }
}

// `low`, `high`: where the content is drawn. A surround is seen behind the scene's box, or alone where the ray misses that.
Composite marchContent(ViewArguments view, uint pixel, vec3 d, vec3 low, vec3 high, uint partCount, bool isSurround) {
  const vec3 o = vectorOf(view.origin);
  const vec2 box = clipToBox(o, d, vectorOf(view.low), vectorOf(view.high), vec2(view.near, 1e30));
  const bool meetsBox = box.x < box.y;
  const float far = farthestOf(view, pixel);
  Composite sum = Composite(vec3(0), vec4(0), 1, 0, 0);
  if (isSurround) {
    const vec2 behind = vec2(meetsBox ? box.y : view.near, far);
    if (behind.x < behind.y) marchPart(partOf(0), o, d, behind, sum);
  } else {
    const vec2 whole = clipToBox(o, d, low, high, vec2(meetsBox ? box.x : view.near, far));
    if (whole.x < whole.y) marchParts(o, d, whole, partCount, sum);
  }
  return sum;
}
