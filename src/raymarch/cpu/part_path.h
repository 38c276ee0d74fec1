// The path of a ray through the domain of one part of a content.
#pragma once

#include "raymarch/content/content_part.h"
#include "render/tile_frame.h"
#include "scene/domain_path.h"

namespace tessera {

// Returns the section of `range` in which the ray is within both the region that a part owns and the part's domain. It
// must not be called for the background block, which owns everything behind the scene's box.
RayRange ownedRange(const ContentPart& part, const SceneRay& ray, const RayRange& range);

// Returns the path of the ray through the domain. `range` must be finite and, for a bounded part, within its domain.
DomainPath partPath(const ContentPart& part, const SceneRay& ray, const RayRange& range);

}  // namespace tessera
