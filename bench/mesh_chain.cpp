// mesh_chain MODEL CAPTURE [PATCH_EDGE]: what each step from a trained mesh to its baked contents loses. Evaluates
// held-out photos with the model; with the faces that extraction keeps; with the triangles of all parts and their
// texels of 8 bits, traced by Embree; with opacities that are stored as opaque from 0.8 on; and of these, after BC4
// compression. Prints PSNR, SSIM, and numbers of faces, patches and bytes as JSON. See mesh.sh.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/threads.h"
#include "compute/device.h"
#include "eval/evaluate.h"
#include "import/capture_reader.h"
#include "representations/mesh/bake/bake_mesh.h"
#include "representations/mesh/cpu/mesh_tracer.h"
#include "representations/mesh/train/mesh_renderer.h"

namespace tessera {
namespace {

// Traces the contents of all parts: those of the blocks together, behind them that of the background block and the sky.
class ContentsRenderer final : public ViewRenderer {
 public:
  ContentsRenderer(TrainedMesh& mesh, const std::vector<MeshContent>& contents) : mesh_(mesh) {
    for (const MeshContent& content : contents) tracers_.emplace_back(content);
    for (const auto& part : mesh.parts)
      if (part->part().isBackground()) sky_ = mesh.device->read(part->sky().values.all());
  }

  RenderedView render(const Camera& camera, const Pose& pose, const ImageF*) override {
    RenderedView view = makeEmptyView(camera);
    pool_.run(static_cast<size_t>(camera.height), [&](size_t row, int) {
      const int y = static_cast<int>(row);
      for (int x = 0; x < camera.width; ++x) {
        const auto inCamera = camera.directionInCamera({x + 0.5, y + 0.5});
        if (!inCamera) continue;
        const CompositedRay ray = trace(pose.translation, (pose.rotation * *inCamera).normalized());
        for (int c = 0; c < 3; ++c) view.colour.at(x, y)[c] = ray.colour[c];
        *view.opacity.at(x, y) = ray.opacity;
        *view.depth.at(x, y) = ray.depth * static_cast<float>(inCamera->normalized().z());
      }
    });
    return view;
  }
  std::string device() const override { return "Embree"; }

 private:
  CompositedRay trace(const Vec3d& eye, const Vec3d& towards) const {
    std::vector<MeshTracer::Hit> hits, behind;
    Vec3f direction = Vec3f::Zero();
    for (size_t i = 0; i < tracers_.size(); ++i) {
      const MeshModel& model = *mesh_.parts[i];
      const SceneFrame& frame = model.frame();
      const Vec3d origin = frame.sceneFromWorld(eye), along = frame.rotation * towards;
      direction = along.cast<float>();
      const bool isBackground = model.part().isBackground();
      const double near = isBackground ? distanceBehind(origin, along, model.part().halfEdges) : model.config().near;
      std::vector<MeshTracer::Hit>& to = isBackground ? behind : hits;
      const size_t first = to.size();
      tracers_[i].addHits(origin.cast<float>(), direction, static_cast<float>(near), 1e6f, to);
      for (size_t h = first; h < to.size(); ++h) to[h].distance /= static_cast<float>(frame.scale);
    }
    constexpr float kMinTransmittance = 1e-3f;
    CompositedRay ray = compositeHits(hits, direction, kMinTransmittance);
    if (sky_.empty()) return ray;
    const CompositedRay outside = compositeHits(behind, direction, kMinTransmittance);
    const std::array<float, 3> sky = skyColour(direction);
    const float share = 1 - ray.opacity;
    for (int c = 0; c < 3; ++c) ray.colour[c] += share * (outside.colour[c] + (1 - outside.opacity) * sky[c]);
    ray.depth += share * outside.depth / std::max(1e-6f, outside.opacity);
    ray.opacity = 1;
    return ray;
  }
  static double distanceBehind(const Vec3d& origin, const Vec3d& direction, const std::array<float, 3>& halfEdges) {
    double enter = 0, leave = 1e30;
    for (int axis = 0; axis < 3; ++axis) {
      if (direction[axis] == 0) continue;
      const double side = std::copysign(double{halfEdges[axis]}, direction[axis]);
      enter = std::max(enter, (-side - origin[axis]) / direction[axis]);
      leave = std::min(leave, (side - origin[axis]) / direction[axis]);
    }
    return enter < leave ? leave : 0;
  }
  // CubeMapForward.
  std::array<float, 3> skyColour(const Vec3f& direction) const {
    constexpr uint32_t kSize = MeshModel::kSkyResolution;
    int axis = 0;
    direction.cwiseAbs().maxCoeff(&axis);
    const float length = std::abs(direction[axis]);
    const auto place = [&](int other) {
      return std::clamp((direction[other] / length + 1) / 2, 0.0f, 1.0f) * (kSize - 1);
    };
    const float column = place((axis + 1) % 3), row = place((axis + 2) % 3);
    const uint32_t x = std::min(static_cast<uint32_t>(column), kSize - 2),
                   y = std::min(static_cast<uint32_t>(row), kSize - 2);
    const size_t side = static_cast<size_t>(2 * axis + (direction[axis] < 0 ? 1 : 0));
    std::array<float, 3> colour{};
    for (uint32_t corner = 0; corner < 4; ++corner) {
      const uint32_t dx = corner & 1, dy = corner >> 1;
      const float right = column - static_cast<float>(x), lower = row - static_cast<float>(y);
      const float weight = (dx ? right : 1 - right) * (dy ? lower : 1 - lower);
      for (size_t c = 0; c < 3; ++c) colour[c] += weight * sky_[3 * ((side * kSize + y + dy) * kSize + x + dx) + c];
    }
    return colour;
  }

  TrainedMesh& mesh_;
  std::vector<MeshTracer> tracers_;
  std::vector<float> sky_;
  ThreadPool pool_{0};
};

nlohmann::ordered_json measure(const fs::path& modelFolder, const fs::path& captureFolder, uint32_t patchEdge) {
  using Clock = std::chrono::steady_clock;
  const auto seconds = [](Clock::time_point since) {
    return std::chrono::duration<double>(Clock::now() - since).count();
  };
  const Capture capture = readCapture(captureFolder);
  const std::unique_ptr<Device> device = makeDevice({});
  TrainedMesh mesh = loadTrainedMesh(*device, modelFolder);
  MeshRenderer renderer(mesh);
  nlohmann::ordered_json result;
  const auto evaluateAs = [&](const char* name, ViewRenderer& source) {
    const EvaluationReport report = evaluate(source, capture, {});
    result[name] = {{"psnr", report.psnr}, {"ssim", report.ssim}};
    for (const ViewResult& view : report.views) result[name]["views"].push_back(view.psnr);
    std::fprintf(stderr, "%s: %.2f dB, SSIM %.3f\n", name, report.psnr, report.ssim);
  };
  evaluateAs("model", renderer);

  const auto extracting = Clock::now();
  std::vector<FaceSet> faces;
  for (const auto& part : mesh.parts) {
    ExtractionSettings settings;
    if (part->part().isBackground()) settings.raysPerCell = 0;
    faces.push_back(extractFaces(*part, 0, capture, settings));
    result["faces"].push_back(faces.back().count());
    part->level(0).keepFaces(faces.back().bits());
  }
  result["extraction_seconds"] = seconds(extracting);
  evaluateAs("kept_faces", renderer);

  for (const bool snapped : {false, true}) {
    MeshBakeSettings settings;
    settings.patchEdge = patchEdge;
    if (!snapped) {
      settings.opaqueFrom = 2;
      settings.transparentBelow = 0;
    }
    const auto baking = Clock::now();
    std::vector<MeshContent> contents;
    uint64_t triangles = 0, patches = 0, pairs = 0;
    for (size_t i = 0; i < mesh.parts.size(); ++i) {
      contents.push_back(bakeMeshContent(*mesh.parts[i], 0, faces[i], settings));
      triangles += contents.back().triangles();
      patches += contents.back().patches();
      pairs += contents.back().pairs;
    }
    if (!snapped) {
      result["bake_seconds"] = seconds(baking);
      result["triangles"] = triangles;
      result["patches"] = patches;
      result["pairs"] = pairs;
      result["texel_bytes_rgba"] = patches * patchEdge * patchEdge * kMeshNumbers;
      result["texel_bytes_bc4"] = patches * patchEdge * patchEdge * kMeshNumbers / 2;
    }
    ContentsRenderer contentsRenderer(mesh, contents);
    evaluateAs(snapped ? "opaque_from_0.8" : "texels_of_8_bits", contentsRenderer);
    if (!snapped || patchEdge % 4 != 0) continue;
    for (const Bc4Effort effort : {Bc4Effort::fast, Bc4Effort::exhaustive}) {
      std::vector<MeshContent> compressed = contents;
      const auto compressing = Clock::now();
      for (MeshContent& content : compressed) passThroughBc4(content, effort);
      const double compressingSeconds = seconds(compressing);
      const char* name = effort == Bc4Effort::fast ? "bc4_fast" : "bc4_exhaustive";
      ContentsRenderer compressedRenderer(mesh, compressed);
      evaluateAs(name, compressedRenderer);
      result[name]["seconds"] = compressingSeconds;
    }
  }
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 3) {
    std::fprintf(stderr, "usage: mesh_chain MODEL CAPTURE [PATCH_EDGE]\n");
    return 2;
  }
  try {
    const uint32_t patchEdge = argc > 3 ? static_cast<uint32_t>(std::atoi(argv[3])) : 8;
    std::printf("%s\n", tessera::measure(argv[1], argv[2], patchEdge).dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_chain: error: %s\n", error.what());
    return 1;
  }
}
