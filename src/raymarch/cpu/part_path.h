// A ray through the domain of one part of a content.
#pragma once

#include "raymarch/content/content_part.h"
#include "render/tile_frame.h"
#include "scene/domain_path.h"

namespace tessera {

// Where the ray is in what a part owns and in its domain. Not for the surround, which owns what lies behind the box.
RayRange ownedRange(const ContentPart& part, const SceneRay& ray, const RayRange& range);

// `range` is finite, and for a bounded part within its domain.
DomainPath partPath(const ContentPart& part, const SceneRay& ray, const RayRange& range);

}  // namespace tessera
