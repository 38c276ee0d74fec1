#include "bake/baker.h"

#include "bake/scene_writer.h"

namespace tessera {

BakedScene bakeScene(Baker& baker, const Capture& capture, const fs::path& scene, const BakeOptions& options) {
  SceneDescription description = baker.description();
  description.name = options.name;
  description.background = options.background.value_or(description.background);
  description.exposureResponse = options.exposureResponse;
  SceneWriter writer(scene, capture, description);
  baker.bake(capture, options, writer);
  return writer.commit();
}

}  // namespace tessera
