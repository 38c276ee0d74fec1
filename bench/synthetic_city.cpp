#include "bench/synthetic_city.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"

namespace tessera {

std::unique_ptr<CityScene> rebuildCity(const fs::path& capture, ThreadPool& pool) {
  const fs::path file = capture / "synth.json";
  try {
    const auto options = nlohmann::json::parse(readTextFile(file));
    int columns = 0, rows = 0;
    std::sscanf(options.at("blocks").get<std::string>().c_str(), "%dx%d", &columns, &rows);
    return std::make_unique<CityScene>(columns, rows, options.at("seed").get<uint64_t>(), pool);
  } catch (const nlohmann::json::exception& error) {
    throw Error(file.string(), "", error.what(), "name a capture that tessera synth city has written");
  }
}

std::optional<Ray> rayThrough(const Camera& camera, const Pose& worldFromCamera, const Vec2d& pixel) {
  constexpr float kNear = 0.05f;  // metres
  const auto inCamera = camera.directionInCamera(pixel);
  if (!inCamera) return std::nullopt;
  return Ray{worldFromCamera.translation.cast<float>(),
             (worldFromCamera.rotation * *inCamera).cast<float>().normalized(), kNear};
}

}  // namespace tessera
