// Marches a ray through one part of a content, piece by piece.
//
// Reads: domain_path.glsl, part_place.glsl; Part, which has a place and the number of `texels` along its domain, the unit of
//   pieces; marchSegment; float minTransmittance.
// Defines: marchPart.

// Composites this part behind `sum`, which holds the content's parts in front of it.
void marchPart(Part part, vec3 origin, vec3 direction, vec2 range, inout Composite sum) {
  vec3 o = (origin - part.place.centre) / part.place.scale, d = direction / part.place.scale;
  bool contracted = part.place.contracted;
  float halfDomain = contracted ? 2.0 : 1.0;
  int region = contracted ? regionAt(o + range.x * d) : kCube;
  float t = range.x;
  int guard = 0;  // at most five regions; rays along the border of two regions can have more pieces, of zero length
  do {
    int next = region;
    float exit = contracted ? min(leaveRegion(o, d, region, next), range.y) : range.y;
    if (exit > t) {
      marchSegment(part, domainSegment(o, d, region, t, exit, halfDomain, part.texels), sum);
      if (sum.transmittance < minTransmittance) return;
      t = exit;
    }
    region = next;
  } while (t < range.y && ++guard < 12);
}
