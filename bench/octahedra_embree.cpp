// octahedra_embree synthetic [SHARE] | MODEL [CAPTURE]: rays per second of TraceOctahedra on the CPU and of Embree,
// which collects all hits of the same rays on the same triangles in order of distance, with two threads each.
//   synthetic  a grid of 64³ cells with three layers of traced cells on a wavy height field, and vertices that are
//              moved at random by up to SHARE (0.4) of the bound; rays look down like those of photos from above
//   MODEL      the finest level of each block of a trained mesh, in the grid and the cells in which training traces it;
//              rays through all pixels of some training photos, those that cross the grid. CAPTURE: its capture, if it
//              is not where blocks.json says
// Rays are grouped by 8 × 8 neighbouring pixels, or in random order, and traced in batches as large as those of
// training. Embree gets all faces whose box of cells reaches a traced cell. Each setting of Embree (hierarchy, size of
// packets, coherence) is tried, and the fastest is compared, in alternation:
//   embree             writes the same arrays as TraceOctahedra; hits outside of traced cells are dropped
//   embree_all_hits    without dropping any
//   embree_lists_only  leaves each ray's sorted hits in a list that the next rays overwrite, which is less than is
//                      needed
// Beside it: how long Embree takes for a new hierarchy after all vertices moved by up to 0.01 cells, as they do in each
// step of training. TraceOctahedra has no such structure.
// Prints JSON, and a line for each comparison on the standard error. See mesh.sh.
#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>

#include "base/error.h"
#include "base/random.h"
#include "bench/embree_hits.h"
#include "bench/octahedra_scene.h"
#include "compute/device.h"
#include "compute/octahedra.h"
#include "import/capture_reader.h"
#include "representations/mesh/train/trained_mesh.h"

namespace tessera {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kThreads = 2, kRounds = 7;
constexpr size_t kHitsOfBatch = size_t{kBatch} * 96;  // capacity

// The faces that each ray hits, in order.
struct FaceLists {
  std::vector<size_t> first = {0};
  std::vector<uint32_t> faces;

  std::span<const uint32_t> list(uint32_t ray) const {
    return std::span(faces).subspan(first[ray], first[ray + 1] - first[ray]);
  }
};

class OctahedraTracer {
 public:
  OctahedraTracer(Device& device, const TracedGrid& traced, const RaySet& rays)
      : device_(device),
        trace_{{&traced.grid, 1}},
        origins_(device.uploadArray(rays.origins)),
        directions_(device.uploadArray(rays.directions)),
        displacements_(device.uploadArray(traced.displacements)),
        tracedCells_(device.uploadArray(traced.tracedCells)),
        first_(device.array<uint32_t>(kBatch + size_t{1})),
        counters_(device.array<uint32_t>(2)),
        rayOfSample_(device.array<uint32_t>(kHitsOfBatch)),
        faces_(device.array<uint32_t>(kHitsOfBatch)),
        barycentrics_(device.array<float>(2 * kHitsOfBatch)),
        positions_(device.array<float>(3 * kHitsOfBatch)),
        distances_(device.array<float>(kHitsOfBatch)) {
    trace_.sampleCapacity = kHitsOfBatch;
    trace_.displacements = displacements_;
    trace_.occupancy = tracedCells_;
    trace_.firstSample = first_;
    trace_.sampleCount = counters_.part(0, 1);
    trace_.finishedRays = counters_.part(1, 1);
    trace_.rayOfSample = rayOfSample_;
    trace_.faces = faces_;
    trace_.barycentrics = barycentrics_;
    trace_.positions = positions_;
    trace_.distances = distances_;
  }

  void trace(uint32_t first, uint32_t count) {
    trace_.rays = {count};
    trace_.origins = origins_.part(size_t{3} * first, size_t{3} * count);
    trace_.directions = directions_.part(size_t{3} * first, size_t{3} * count);
    device_.run(trace_);
    device_.finish();
  }
  // Adds the hits of the last batch.
  void append(FaceLists& lists) const {
    const std::vector<uint32_t> counters = device_.read(counters_.all());
    const uint32_t rays = trace_.rays.capacity;
    CHECK(counters[1] == rays);  // else kHitsOfBatch is too small
    const auto [first, faces] = device_.readAll(Slice<const uint32_t>(first_.part(0, rays + size_t{1})),
                                                Slice<const uint32_t>(faces_.part(0, counters[0])));
    const size_t before = lists.faces.size();
    for (size_t ray = 1; ray < first.size(); ++ray) lists.first.push_back(before + first[ray]);
    lists.faces.insert(lists.faces.end(), faces.begin(), faces.end());
  }

 private:
  Device& device_;
  TraceOctahedra trace_;
  const Array<float> origins_, directions_, displacements_;
  const Array<uint32_t> tracedCells_;
  Array<uint32_t> first_, counters_, rayOfSample_, faces_;
  Array<float> barycentrics_, positions_, distances_;
};

// Calls `traceBatch(first, count)` for all batches, and returns rays per second.
template <class TraceBatch>
double measureRate(const RaySet& rays, const TraceBatch& traceBatch) {
  const auto begin = std::chrono::steady_clock::now();
  for (uint32_t first = 0; first < rays.count(); first += kBatch)
    traceBatch(first, std::min(kBatch, rays.count() - first));
  const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - begin;
  return rays.count() / seconds.count();
}

double median(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  const size_t half = values.size() / 2;
  return values.size() % 2 == 1 ? values[half] : (values[half - 1] + values[half]) / 2;
}

class EmbreeRun {
 public:
  EmbreeRun(EmbreeTracer& tracer, const RaySet& rays, HitArrays& hits) : tracer_(tracer), rays_(rays), hits_(hits) {}

  void trace(const EmbreeTriangles& triangles, const EmbreeQuery& query, uint32_t first, uint32_t count) {
    const EmbreeRays batch{&rays_.gridOrigins[size_t{3} * first], &rays_.gridDirections[size_t{3} * first], count};
    tracer_.trace(triangles, query, batch, hits_);
  }
  double rate(const EmbreeTriangles& triangles, const EmbreeQuery& query) {
    return measureRate(rays_, [&](uint32_t first, uint32_t count) { trace(triangles, query, first, count); });
  }
  FaceLists list(const EmbreeTriangles& triangles, const EmbreeQuery& query, const std::vector<uint32_t>& faces) {
    FaceLists lists;
    measureRate(rays_, [&](uint32_t first, uint32_t count) {
      trace(triangles, query, first, count);
      const size_t before = lists.faces.size();
      for (size_t ray = 1; ray <= count; ++ray) lists.first.push_back(before + hits_.firstHit[ray]);
      for (size_t hit = 0; hit < hits_.firstHit[count]; ++hit) lists.faces.push_back(faces[hits_.triangles[hit]]);
    });
    return lists;
  }

 private:
  EmbreeTracer& tracer_;
  const RaySet& rays_;
  HitArrays& hits_;
};

Json compareHits(const FaceLists& ours, const FaceLists& theirs) {
  const uint32_t rays = static_cast<uint32_t>(ours.first.size() - 1);
  CHECK(theirs.first.size() == ours.first.size());
  size_t sameCount = 0, sameFaces = 0, sameOrder = 0, hit = 0, missingInEmbree = 0, missingInOurs = 0;
  for (uint32_t ray = 0; ray < rays; ++ray) {
    const std::span<const uint32_t> a = ours.list(ray), b = theirs.list(ray);
    hit += !a.empty();
    sameCount += a.size() == b.size();
    sameOrder += std::equal(a.begin(), a.end(), b.begin(), b.end());
    std::vector<uint32_t> sortedA(a.begin(), a.end()), sortedB(b.begin(), b.end()), difference;
    std::sort(sortedA.begin(), sortedA.end());
    std::sort(sortedB.begin(), sortedB.end());
    sameFaces += sortedA == sortedB;
    std::set_difference(sortedA.begin(), sortedA.end(), sortedB.begin(), sortedB.end(), std::back_inserter(difference));
    missingInEmbree += difference.size();
    difference.clear();
    std::set_difference(sortedB.begin(), sortedB.end(), sortedA.begin(), sortedA.end(), std::back_inserter(difference));
    missingInOurs += difference.size();
  }
  const double all = rays;
  return {{"share_of_rays_with_hits", hit / all},
          {"share_with_equal_number_of_hits", sameCount / all},
          {"share_with_equal_faces", sameFaces / all},
          {"share_with_equal_faces_in_order", sameOrder / all},
          {"hits", ours.faces.size()},
          {"hits_of_embree", theirs.faces.size()},
          {"hits_missing_in_embree", missingInEmbree},
          {"hits_missing_in_ours", missingInOurs}};
}

struct Setting {
  HierarchyQuality quality;
  EmbreeQuery query;

  std::string describe() const {
    if (query.packet == 1) return fmt::format("{}, single rays", nameQuality(quality));
    return fmt::format("{}, packets of {}, {}", nameQuality(quality), query.packet,
                       query.coherent ? "coherent" : "incoherent");
  }
};

class Comparison {
 public:
  Comparison(Device& device, const TracedGrid& traced)
      : device_(device),
        traced_(traced),
        faces_(listTriangles(traced)),
        embree_(kThreads),
        tracer_(kThreads),
        hits_(kBatch, kHitsOfBatch),
        high_(embree_, faces_.triangles, HierarchyQuality::high),
        medium_(embree_, faces_.triangles, HierarchyQuality::medium),
        low_(embree_, faces_.triangles, HierarchyQuality::low),
        refit_(embree_, faces_.triangles, HierarchyQuality::refit) {
    hits_.positionScale = traced.grid.positionScale();
  }

  Json measure(const std::vector<RaySet>& raySets) {
    Json result = {{"name", traced_.name}};
    size_t cells = 0;
    for (const uint32_t word : traced_.tracedCells) cells += static_cast<size_t>(std::popcount(word));
    result["resolution"] = traced_.grid.resolution;
    result["traced_cells"] = cells;
    result["triangles"] = faces_.triangles.triangles();
    result["vertices"] = faces_.vertexCells.size();
    for (const RaySet& rays : raySets) result["orders"].push_back(compare(rays));
    result["rebuild_ms"] = measureRebuild();
    const Json& first = result["orders"][0];
    const auto step = [&](const char* rate, const char* rebuild) {
      return 1e3 * kBatch / first.at(rate).get<double>() +
             (rebuild ? result["rebuild_ms"].at(rebuild).get<double>() : 0.0);
    };
    result["step_ms"] = {{"rays", kBatch},
                         {"ours", step("rays_per_second", nullptr)},
                         {"embree_low", step("embree_low_rays_per_second", "low")},
                         {"embree_refit", step("embree_refit_rays_per_second", "refit")},
                         {"embree_medium", step("embree_medium_rays_per_second", "medium")}};
    const auto number = [&](const char* group, const char* name) { return result[group].at(name).get<double>(); };
    result["table"] = fmt::format(
        "{}: new hierarchy of Embree after a step in ms: {:.1f} (high), {:.1f} (medium), {:.1f} (low), {:.1f} (refit); "
        "with it, {} rays in ms: {:.1f} (medium), {:.1f} (low), {:.1f} (refit), ours {:.1f}",
        traced_.name, number("rebuild_ms", "high"), number("rebuild_ms", "medium"), number("rebuild_ms", "low"),
        number("rebuild_ms", "refit"), kBatch, number("step_ms", "embree_medium"), number("step_ms", "embree_low"),
        number("step_ms", "embree_refit"), number("step_ms", "ours"));
    std::fprintf(stderr, "%s\n", result["table"].get<std::string>().c_str());
    return result;
  }

 private:
  CountedCells countedCells() const { return {traced_.grid.resolution, traced_.tracedCells.data()}; }
  const EmbreeTriangles& hierarchy(HierarchyQuality quality) const {
    return quality == HierarchyQuality::high     ? high_
           : quality == HierarchyQuality::medium ? medium_
           : quality == HierarchyQuality::low    ? low_
                                                 : refit_;
  }

  // Tries all settings, the second time of each counts, and returns the fastest.
  Setting chooseSetting(EmbreeRun& run, Json& tried) {
    Setting best{};
    double bestRate = 0;
    for (const HierarchyQuality quality : {HierarchyQuality::high, HierarchyQuality::medium}) {
      for (const uint32_t packet : {1u, 8u, 16u}) {
        for (const bool coherent : {false, true}) {
          if (packet == 1 && coherent) continue;  // is ignored
          const Setting setting{quality, {packet, coherent, countedCells()}};
          run.rate(hierarchy(quality), setting.query);
          const double rate = run.rate(hierarchy(quality), setting.query);
          tried.push_back({{"setting", setting.describe()}, {"rays_per_second", rate}});
          if (rate <= bestRate) continue;
          bestRate = rate;
          best = setting;
        }
      }
    }
    return best;
  }

  Json compare(const RaySet& rays) {
    Json result = {{"order", rays.order}, {"rays", rays.count()}};
    OctahedraTracer ours(device_, traced_, rays);
    EmbreeRun run(tracer_, rays, hits_);
    FaceLists lists;
    measureRate(rays, [&](uint32_t first, uint32_t count) {
      ours.trace(first, count);
      ours.append(lists);
    });
    Json tried;
    const Setting best = chooseSetting(run, tried);
    const EmbreeTriangles& triangles = hierarchy(best.quality);
    EmbreeQuery allHits = best.query, listsOnly = best.query;
    allHits.cells = {};
    listsOnly.writesHits = false;
    const FaceLists theirs = run.list(triangles, best.query, faces_.faces);
    result["hits_per_ray"] = static_cast<double>(lists.faces.size()) / rays.count();
    result["all_hits_per_ray"] =
        static_cast<double>(run.list(triangles, allHits, faces_.faces).faces.size()) / rays.count();
    result["agreement"] = compareHits(lists, theirs);
    run.rate(triangles, listsOnly);
    run.rate(low_, best.query);
    run.rate(refit_, best.query);

    std::vector<double> rate, embree, all, only, low, refit, medium, ratios;
    for (int round = 0; round < kRounds; ++round) {
      rate.push_back(measureRate(rays, [&](uint32_t first, uint32_t count) { ours.trace(first, count); }));
      embree.push_back(run.rate(triangles, best.query));
      ratios.push_back(rate.back() / embree.back());
      all.push_back(run.rate(triangles, allHits));
      only.push_back(run.rate(triangles, listsOnly));
      medium.push_back(run.rate(medium_, best.query));
      low.push_back(run.rate(low_, best.query));
      refit.push_back(run.rate(refit_, best.query));
    }
    result["rays_per_second"] = median(rate);
    result["embree_rays_per_second"] = median(embree);
    result["ratio"] = median(rate) / median(embree);
    result["ratio_of_rounds"] = {*std::min_element(ratios.begin(), ratios.end()),
                                 *std::max_element(ratios.begin(), ratios.end())};
    result["embree_setting"] = best.describe();
    result["embree_all_hits_rays_per_second"] = median(all);
    result["embree_lists_only_rays_per_second"] = median(only);
    result["embree_medium_rays_per_second"] = median(medium);
    result["embree_low_rays_per_second"] = median(low);
    result["embree_refit_rays_per_second"] = median(refit);
    result["embree_settings"] = tried;
    result["table"] = fmt::format(
        "{}, {}: {} rays with {:.1f} hits on {} triangles, equal faces for {:.3f} %; M rays/s: ours {:.3f}, Embree "
        "{:.3f} "
        "({}), ratio {:.2f}; Embree with the {:.1f} hits in all cells {:.3f}, without output {:.3f}",
        traced_.name, rays.order, rays.count(), result["hits_per_ray"].get<double>(), faces_.triangles.triangles(),
        100 * result["agreement"]["share_with_equal_faces"].get<double>(), median(rate) / 1e6, median(embree) / 1e6,
        best.describe(), result["ratio"].get<double>(), result["all_hits_per_ray"].get<double>(), median(all) / 1e6,
        median(only) / 1e6);
    std::fprintf(stderr, "%s\n", result["table"].get<std::string>().c_str());
    return result;
  }

  Json measureRebuild() {
    const RandomStream random(1, 3);
    std::vector<float> displacements = traced_.displacements;
    for (size_t i = 0; i < displacements.size(); ++i)
      displacements[i] =
          std::clamp(displacements[i] + 0.01f * (2 * random.uniform(i) - 1), -kMaxDisplacement, kMaxDisplacement);
    const std::vector<float> moved = placeVertices(traced_.grid, faces_.vertexCells, displacements);
    Json result;
    for (EmbreeTriangles* triangles : {&high_, &medium_, &low_, &refit_}) {
      std::vector<double> milliseconds;
      for (int round = 0; round < 2 * kRounds; ++round)
        milliseconds.push_back(1e3 * triangles->moveVertices(round % 2 == 0 ? moved : faces_.triangles.vertices));
      constexpr HierarchyQuality kQualities[] = {HierarchyQuality::high, HierarchyQuality::medium,
                                                 HierarchyQuality::low, HierarchyQuality::refit};
      result[nameQuality(kQualities[result.size()])] = median(milliseconds);
    }
    return result;
  }

  Device& device_;
  const TracedGrid& traced_;
  FaceTriangles faces_;
  EmbreeDevice embree_;
  EmbreeTracer tracer_;
  HitArrays hits_;
  EmbreeTriangles high_, medium_, low_, refit_;
};

Json measureGrid(Device& device, const TracedGrid& traced, const RaySet& rays) {
  return Comparison(device, traced).measure({rays, shuffle(rays, traced.grid)});
}

Json measureSynthetic(Device& device, double share) {
  const TracedGrid traced = makeSyntheticGrid(share);
  return Json::array({measureGrid(device, traced, makeSyntheticRays(traced.grid))});
}

Json measureModel(Device& device, const fs::path& model, fs::path captureFolder) {
  constexpr size_t kMaxRays = 500000;
  const ModelFolder folder(model);
  if (captureFolder.empty()) captureFolder = folder.readPlacement().capture;
  const Capture capture = readCapture(captureFolder);
  requireSameWorld(folder, capture);
  const std::vector<int> all = capture.photosIn(Split::train);
  if (all.empty()) throw Error(captureFolder.string(), "", "has no training photos", "name the capture of the model");
  const Camera& camera = capture.cameras[static_cast<size_t>(capture.photos[static_cast<size_t>(all[0])].camera)];
  const size_t pixels = static_cast<size_t>(camera.width) * static_cast<size_t>(camera.height);
  const size_t count = std::clamp<size_t>(kMaxRays / pixels, 1, all.size());
  std::vector<int> photos;
  for (size_t i = 0; i < count; ++i) photos.push_back(all[(2 * i + 1) * all.size() / (2 * count)]);
  TrainedMesh mesh = loadTrainedMesh(device, model);
  Json cases = Json::array();
  for (const std::unique_ptr<MeshModel>& part : mesh.parts) {
    if (part->part().isBackground()) continue;  // its grids are projective
    MeshLevel& level = part->level(0);
    const TracedGrid traced{part->part().name, level.domain().grids[0], device.read(level.displacements().values.all()),
                            level.tracedCells()};
    const RaySet rays = makePhotoRays(device, capture, photos, part->frame(), traced.grid);
    if (rays.count() > 0) cases.push_back(measureGrid(device, traced, rays));
  }
  return cases;
}

Json measure(int argc, char** argv) {
  DeviceOptions options;
  options.kind = "cpu";
  options.threads = kThreads;
  const std::unique_ptr<Device> device = makeDevice(options);
  double load[1] = {};
  getloadavg(load, 1);
  Json result = {
      {"device", device->name()}, {"embree", RTC_VERSION_STRING}, {"threads", kThreads}, {"load_before", load[0]}};
  if (std::string(argv[1]) == "synthetic") {
    result["cases"] = measureSynthetic(*device, argc > 2 ? std::atof(argv[2]) : 0.4);
  } else {
    result["model"] = argv[1];
    result["cases"] = measureModel(*device, argv[1], argc > 2 ? argv[2] : "");
  }
  return result;
}

}  // namespace
}  // namespace tessera

int main(int argc, char** argv) {
  if (argc < 2 || argc > 3) {
    std::fprintf(stderr, "octahedra_embree synthetic [SHARE] | MODEL [CAPTURE]\n");
    return 2;
  }
  try {
    std::printf("%s\n", tessera::measure(argc, argv).dump(2).c_str());
    return 0;
  } catch (const std::exception& error) {
    std::fprintf(stderr, "octahedra_embree: %s\n", error.what());
    return 1;
  }
}
