// mesh_chain MODEL CAPTURE [PATCH_EDGE [TRIANGLES [MIN_OPACITY]]]: what each step from a trained mesh to its baked
// contents loses. Evaluates held-out photos with the model; with the faces that rays see; with those of them that
// extraction keeps; with the triangles of all parts and their texels of 8 bits, traced by Embree; with opacities that
// are 0 or 1 alone; with those that contents store; and with these after BC4 compression. At most TRIANGLES faces are
// kept, those that contribute most. MIN_OPACITY: of hits that count as seen (ExtractionSettings::minOpacity). Prints
// PSNR, SSIM, LPIPS (with the weights that LPIPS names), hits per ray, and numbers of faces, patches and bytes as JSON;
// of the blocks also the kept share of the faces in their boxes, and the kept faces for each cell in which there are
// some. See mesh.sh.
#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <set>

#include "base/error.h"
#include "base/threads.h"
#include "bench/evaluation.h"
#include "compute/device.h"
#include "eval/evaluate.h"
#include "import/capture_reader.h"
#include "representations/mesh/bake/bake_mesh.h"
#include "representations/mesh/cpu/mesh_tracer.h"
#include "representations/mesh/train/mesh_patches.h"
#include "representations/mesh/train/mesh_renderer.h"

namespace tessera {
namespace {

// Traces the patches of all parts: those of the blocks together, behind them those of the background block and the sky.
class PatchesRenderer final : public ViewRenderer, private HitShading {
 public:
  PatchesRenderer(TrainedMesh& mesh, const std::vector<BakedPatches>& patches) : mesh_(mesh), patches_(patches) {
    for (const BakedPatches& part : patches) {
      PatchTriangles triangles;
      triangles.pairs = part.pairs;
      triangles.vertices.assign(part.vertices.begin(), part.vertices.end());
      tracers_.emplace_back(std::span(&triangles, 1));
      decoders_.emplace_back(part.decoder, kMeshFeatures + kMeshHarmonics, 3);
    }
    for (const auto& part : mesh.parts) {
      if (!part->part().isBackground()) continue;
      sky_.isBackground = true;
      sky_.skyEdge = MeshModel::kSkyResolution;
      for (const float number : mesh.device->read(part->sky().values.all()))
        sky_.sky.push_back(FeatureRange{0, 1}.encode(number));
    }
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
        *view.opacity.at(x, y) = 1 - ray.transmittance;
        ++rays_;
        hits_ += ray.samples;
        *view.depth.at(x, y) = ray.depth * static_cast<float>(inCamera->normalized().z());
      }
    });
    return view;
  }
  std::string device() const override { return "Embree"; }
  // Hits per ray whose colours were evaluated.
  double hitsPerRay() const { return static_cast<double>(hits_) / static_cast<double>(std::max<uint64_t>(1, rays_)); }

 private:
  MeshTexel texel(const MeshHit& hit) const override {
    const BakedPatches& part = patches_[hit.content];
    const float last = static_cast<float>(part.patchEdge - 1);
    return mixTexels(part, hit.patch, hit.column * last, hit.row * last);
  }
  const DenseNetwork& decoder(const MeshHit& hit) const override { return decoders_[hit.content]; }

  CompositedRay trace(const Vec3d& eye, const Vec3d& towards) const {
    std::vector<MeshHit> hits, behind;
    Vec3d direction = Vec3d::Zero();
    for (uint32_t i = 0; i < tracers_.size(); ++i) {
      const MeshModel& model = *mesh_.parts[i];
      const SceneFrame& frame = model.frame();
      const Vec3d origin = frame.sceneFromWorld(eye);
      direction = frame.rotation * towards;
      const bool isBackground = model.part().isBackground();
      const double near =
          isBackground ? distanceBehind(origin, direction, model.part().halfEdges) : model.config().near;
      std::vector<MeshHit>& to = isBackground ? behind : hits;
      const size_t first = to.size();
      tracers_[i].addHits(origin.cast<float>(), direction.cast<float>(), static_cast<float>(near), 1e6f, to);
      for (size_t h = first; h < to.size(); ++h) {
        to[h].distance /= static_cast<float>(frame.scale);
        to[h].content = i;
      }
    }
    constexpr float kMinTransmittance = 1e-3f;
    CompositedRay ray;
    compositeHits(hits, direction, kMinTransmittance, *this, ray);
    compositeHits(behind, direction, kMinTransmittance, *this, ray);
    if (sky_.skyEdge == 0) return ray;
    const std::array<float, 3> sky = skyColour(sky_, direction);
    for (int c = 0; c < 3; ++c) ray.colour[c] += ray.transmittance * sky[c];
    ray.depth /= std::max(1e-6f, 1 - ray.transmittance);
    ray.transmittance = 0;
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

  TrainedMesh& mesh_;
  const std::vector<BakedPatches>& patches_;
  std::vector<MeshTracer> tracers_;
  std::vector<DenseNetwork> decoders_;
  MeshContent sky_;  // only its sky
  std::atomic<uint64_t> rays_ = 0, hits_ = 0;
  ThreadPool pool_{0};
};

// Removes the faces that contribute least, until at most so many of all parts are left.
void limitFaces(std::vector<FaceSet>& faces, size_t most) {
  const auto reduced = [&](double share) {
    std::vector<FaceSet> some = faces;
    for (FaceSet& part : some) part.dropLeast(share);
    return some;
  };
  const auto count = [](const std::vector<FaceSet>& sets) {
    size_t sum = 0;
    for (const FaceSet& part : sets) sum += part.count();
    return sum;
  };
  if (count(faces) <= most) return;
  double low = 0, high = 1;
  for (int i = 0; i < 30; ++i) {
    const double middle = (low + high) / 2;
    (count(reduced(middle)) > most ? low : high) = middle;
  }
  faces = reduced(high);
}

// The faces of blocks in their contents, relative to those of the cells in their boxes.
struct BlockFaces {
  double all = 0, extracted = 0, cells = 0;  // cells: that contain the centre of an extracted one

  void add(MeshModel& model, const FaceSet& faces) {
    const OctahedraDomain& domain = model.level(0).domain();
    const OctahedraGrid& own = domain.ownGrids[0];
    double cellsOfBox = 1;
    for (size_t axis = 0; axis < 3; ++axis) {
      const auto limited = [&](float at) { return std::clamp(at, 0.0f, static_cast<float>(own.resolution)); };
      cellsOfBox *= limited(own.highest[axis]) - limited(own.lowest[axis]);
    }
    all += cellsOfBox * kFacesPerCell / (own.placement == OctahedraPlacement::all ? 1 : 2);
    const TriangleList list = listTriangles(
        domain.grids, domain.ownGrids, model.device().read(model.level(0).displacements().values.all()), faces.bits());
    extracted += static_cast<double>(list.triangles.size());
    std::set<uint32_t> places;
    for (const auto& triangle : list.triangles) {
      const Vec3d sum = list.vertices[triangle[0]] + list.vertices[triangle[1]] + list.vertices[triangle[2]];
      if (const auto cell = domain.latticeCell(sum / 3)) places.insert(*cell);
    }
    cells += static_cast<double>(places.size());
  }
};

nlohmann::ordered_json measure(const fs::path& modelFolder, const fs::path& captureFolder, uint32_t patchEdge,
                               size_t most, float minOpacity) {
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
    const EvaluationReport report = evaluate(source, capture, optionsOfEnvironment());
    result[name] = describeQuality(report);
    for (const ViewResult& view : report.views) result[name]["views"].push_back(view.psnr);
    std::fprintf(stderr, "%s: %.2f dB, SSIM %.3f\n", name, report.psnr, report.ssim);
  };
  evaluateAs("model", renderer);

  const auto extracting = Clock::now();
  std::vector<FaceSet> faces;
  for (const auto& part : mesh.parts) {
    ExtractionSettings settings;
    settings.minOpacity = minOpacity;
    if (part->part().isBackground()) settings.raysPerCell = 0;
    faces.push_back(extractFaces(*part, 0, capture, nullptr, settings));
    result["faces_seen"].push_back(faces.back().count());
  }
  result["extraction_seconds"] = seconds(extracting);
  for (size_t i = 0; i < faces.size(); ++i) mesh.parts[i]->level(0).keepFaces(faces[i].bits());
  evaluateAs("seen_faces", renderer);
  for (size_t i = 0; i < faces.size(); ++i) {
    faces[i].dropLeast(mesh.parts[i]->config().droppedShare);
    result["faces"].push_back(faces[i].count());
  }
  limitFaces(faces, most);
  BlockFaces blocks;
  for (size_t i = 0; i < faces.size(); ++i) {
    mesh.parts[i]->level(0).keepFaces(faces[i].bits());
    if (!mesh.parts[i]->part().isBackground()) blocks.add(*mesh.parts[i], faces[i]);
  }
  result["kept_share"] = blocks.extracted / blocks.all;
  result["kept_per_cell"] = blocks.extracted / blocks.cells;
  evaluateAs("kept_faces", renderer);

  struct Snapping {
    const char* name;
    float opaqueFrom, transparentBelow;
  };
  for (const Snapping& snapping :
       {Snapping{"texels_of_8_bits", 2, 0}, Snapping{"binarised_at_0.5", 0.5f, 0.5f},
        Snapping{"opaque_from_0.8", StoredOpacity::kOpaqueFrom, StoredOpacity::kTransparentBelow}}) {
    MeshBakeSettings settings;
    settings.patchEdge = patchEdge;
    settings.opaqueFrom = snapping.opaqueFrom;
    settings.transparentBelow = snapping.transparentBelow;
    const bool isFirst = result.find("bake_seconds") == result.end();
    const auto baking = Clock::now();
    std::vector<BakedPatches> contents;
    uint64_t triangles = 0, patches = 0, pairs = 0;
    for (size_t i = 0; i < mesh.parts.size(); ++i) {
      contents.push_back(bakePatches(*mesh.parts[i], 0, faces[i], settings));
      triangles += contents.back().triangles();
      patches += contents.back().patches();
      pairs += contents.back().pairs;
    }
    if (isFirst) {
      result["bake_seconds"] = seconds(baking);
      result["triangles"] = triangles;
      result["patches"] = patches;
      result["pairs"] = pairs;
      constexpr uint64_t kNumbersOfRgba = (BakedPatches::kNumbers + 3) / 4 * 4;  // three textures of four numbers
      result["texel_bytes_rgba"] = patches * patchEdge * patchEdge * kNumbersOfRgba;
      result["texel_bytes_bc4"] = patches * patchEdge * patchEdge * BakedPatches::kNumbers / 2;
    }
    PatchesRenderer patchesRenderer(mesh, contents);
    evaluateAs(snapping.name, patchesRenderer);
    result[snapping.name]["hits_per_ray"] = patchesRenderer.hitsPerRay();
    if (snapping.name != std::string("opaque_from_0.8") || patchEdge % 4 != 0) continue;
    constexpr uint32_t kLargestExhaustive = 8;  // it takes minutes for each block, and longer with more texels
    for (const Bc4Effort effort : {Bc4Effort::fast, Bc4Effort::exhaustive}) {
      if (effort == Bc4Effort::exhaustive && patchEdge > kLargestExhaustive) continue;
      std::vector<BakedPatches> compressed = contents;
      const auto compressing = Clock::now();
      for (BakedPatches& content : compressed) passThroughBc4(content, effort);
      const double compressingSeconds = seconds(compressing);
      const char* name = effort == Bc4Effort::fast ? "bc4_fast" : "bc4_exhaustive";
      PatchesRenderer compressedRenderer(mesh, compressed);
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
    std::fprintf(stderr, "usage: mesh_chain MODEL CAPTURE [PATCH_EDGE [TRIANGLES [MIN_OPACITY]]]\n");
    return 2;
  }
  try {
    const uint32_t patchEdge = argc > 3 ? static_cast<uint32_t>(std::atoi(argv[3])) : 8;
    const size_t most = argc > 4 ? static_cast<size_t>(std::atoll(argv[4])) : SIZE_MAX;
    const float minOpacity =
        argc > 5 ? static_cast<float>(std::atof(argv[5])) : tessera::ExtractionSettings{}.minOpacity;
    std::printf("%s\n", tessera::measure(argv[1], argv[2], patchEdge, most, minOpacity).dump(2).c_str());
    return 0;
  } catch (const tessera::Error& error) {
    std::fprintf(stderr, "mesh_chain: error: %s\n", error.what());
    return 1;
  }
}
