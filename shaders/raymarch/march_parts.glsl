// Marches a pixel's ray through a content.
// Reads: march_part.glsl; view.glsl; Part fetchPart(uint), Place placeOfPart(uint); float minTransmittance. Defines:
// marchContent().

// Marches the part of the ray that the content owns, part by part in the order in which the ray enters them.
void marchParts(vec3 o, vec3 d, vec2 whole, uint partCount, inout Composite sum) {
  float entered = 0;  // entry and number of the previous part
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
    marchPart(fetchPart(nearest), o, d, range, sum);
    entered = range.x;
    last = nearest;
  }
}

// `low`, `high`: the box in which the content is drawn. A background block is drawn behind the scene's box, or alone if
// the ray misses the box.
Composite marchContent(ViewArguments view, uint pixel, vec3 d, vec3 low, vec3 high, uint partCount, bool isBackgroundBlock) {
  const vec3 o = toVec3(view.origin);
  const vec2 box = clipToBox(o, d, toVec3(view.low), toVec3(view.high), vec2(view.near, 1e30));
  const bool meetsBox = box.x < box.y;
  const float far = farthestDistance(view, pixel);
  Composite sum = Composite(vec3(0), vec4(0), 1, 0, 0);
  if (isBackgroundBlock) {
    const vec2 behind = vec2(meetsBox ? box.y : view.near, far);
    if (behind.x < behind.y) marchPart(fetchPart(0), o, d, behind, sum);
  } else {
    const vec2 whole = clipToBox(o, d, low, high, vec2(meetsBox ? box.x : view.near, far));
    if (whole.x < whole.y) marchParts(o, d, whole, partCount, sum);
  }
  return sum;
}
