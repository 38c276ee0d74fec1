// The roofline rows of networks and hash grids, which take most of the training time.

#include <fmt/format.h>

#include <algorithm>

#include "compute/deferred.h"
#include "compute/hash_grid.h"
#include "compute/mlp.h"
#include "compute/roofline_recorder.h"

namespace tessera {
namespace {

struct Network {
  MlpShape shape;
  bool grouped = false;  // the input has the layout of the hash grid
};

double weights(const MlpShape& shape) {
  return static_cast<double>(shape.inputs) * shape.width +
         static_cast<double>(shape.width) * shape.width * (shape.hiddenLayers - 1) +
         static_cast<double>(shape.width) * shape.outputs;
}

void measureNetwork(RooflineRecorder& recorder, const Network& network, const std::string& title, uint32_t n) {
  const MlpShape& shape = network.shape;
  Device& device = recorder.device();
  const uint32_t inputs = shape.inputs, outputs = shape.outputs;
  const size_t planeRows = Matrix<float>::rowsOfPlane(n);
  const auto inputMatrix = [&](Array<float>& data) {
    return network.grouped ? Matrix<float>::grouped(data, inputs, 2, planeRows) : Matrix<float>(data, inputs);
  };
  Array<float> x = recorder.randomFloats(planeRows * inputs, -1, 1);
  Array<float> w = recorder.randomFloats(shape.parameters(), -0.2f, 0.2f);
  Array<float> dy = recorder.randomFloats(size_t{n} * outputs, -1, 1);
  Array<float> y = device.array<float>(size_t{n} * outputs), dx = device.array<float>(planeRows * inputs);
  Array<float> activations = device.allocateActivations(shape, n);
  Array<float> dw = device.array<float>(shape.parameters());
  const MlpForward forward{shape, {n, {}}, inputMatrix(x), w, Matrix<float>(y, outputs), activations};
  const MlpBackward backward{
      shape, {n, {}}, inputMatrix(x), w, Matrix<float>(y, outputs), activations, Matrix<float>(dy, outputs),
      {},    dw,      inputMatrix(dx)};
  const double flops = 2 * weights(shape) * n;
  const double limit = std::max(recorder.limits().flops, recorder.limits().matrixFlops);
  const std::string where = fmt::format("{}, {} samples", title, n);
  const double in = sizeof(float) * static_cast<double>(n) * inputs;
  const double out = sizeof(float) * static_cast<double>(n) * outputs;
  const double forwardBytes = in + out + static_cast<double>(activations.size()) * sizeof(float);
  const double backwardBytes = forwardBytes + out + in;
  const auto work = [&](const char* name, double amount, double bytes) {
    return RooflineRecorder::Work{name, where, amount, "FLOP", limit, amount / bytes * recorder.streamLimit(bytes)};
  };
  recorder.measure(kOperation<MlpForward>, work("MlpForward", flops, forwardBytes), [&] { device.run(forward); });
  recorder.measure(kOperation<MlpBackward>, work("MlpBackward", 2 * flops, backwardBytes),
                   [&] { device.run(backward); });
  recorder.measure(kOperation<MlpBackward>, work("Mlp both", 3 * flops, forwardBytes + backwardBytes), [&] {
    device.run(forward);
    device.run(backward);
  });
}

// Measures deferred networks on rays that pass through two of four blocks each.
void measureDeferred(RooflineRecorder& recorder, uint32_t n) {
  constexpr uint32_t kNetworks = 4;
  Device& device = recorder.device();
  std::vector<uint32_t> networks(n), rays(n);
  std::vector<float> directions(size_t{3} * (n / 2 + 1));
  for (uint32_t s = 0; s < n; ++s) {
    networks[s] = (s / 64 + s % 2) % kNetworks;
    rays[s] = s / 2;
  }
  for (size_t i = 0; i < directions.size(); i += 3) directions[i + i / 3 % 3] = 1;
  Array<uint32_t> networkOfSegment = device.uploadArray(networks), rayOfSegment = device.uploadArray(rays);
  Array<float> direction = device.uploadArray(directions), composited = recorder.randomFloats(size_t{n} * 7, 0, 1);
  Array<float> weights = recorder.randomFloats(size_t{kNetworks} * DeferredNetwork::kParameters, -0.3f, 0.3f);
  Array<float> specular = device.array<float>(size_t{n} * 3);
  Array<float> upstream = recorder.randomFloats(size_t{n} * 3, -1, 1);
  Array<float> compositedGradients = device.array<float>(size_t{n} * 7);
  Array<float> weightGradients = device.array<float>(weights.size());
  const double flops = 2.0 * DeferredNetwork::kParameters * n, limit = recorder.limits().flops;
  const std::string where = fmt::format("deferred 34-16-16-3, {} segments", n);
  recorder.measure(kOperation<DeferredForward>, {"DeferredForward", where, flops, "FLOP", limit}, [&] {
    device.run(DeferredForward{{n, {}}, composited, networkOfSegment, rayOfSegment, direction, weights, specular});
  });
  recorder.measure(kOperation<DeferredBackward>, {"DeferredBackward", where, 2 * flops, "FLOP", limit}, [&] {
    device.run(DeferredBackward{{n, {}},
                                composited,
                                networkOfSegment,
                                rayOfSegment,
                                direction,
                                weights,
                                upstream,
                                compositedGradients,
                                weightGradients});
  });
}

void measureHashGrid(RooflineRecorder& recorder, const HashGrid& grid, const std::string& title,
                     const std::vector<float>& points, double limit) {
  Device& device = recorder.device();
  const uint32_t n = static_cast<uint32_t>(points.size() / 3);
  const size_t planeRows = Matrix<float>::rowsOfPlane(n);
  Array<float> positions = device.uploadArray(points);
  Array<float> table = recorder.randomFloats(grid.parameters(), -1e-4f, 1e-4f);
  Array<float> upstream = recorder.randomFloats(planeRows * grid.columns(), -1, 1);
  Array<float> encoded = device.array<float>(planeRows * grid.columns()),
               gradients = device.array<float>(grid.parameters());
  const uint32_t features = static_cast<uint32_t>(grid.features);
  const double lookups = 8.0 * static_cast<double>(grid.levels.size()) * n;
  const std::string where = fmt::format("{} levels x {}, {}, {} samples", grid.levels.size(), features, title, n);
  const HashGridForward forward{
      grid, {n, {}}, positions, table, Matrix<float>::grouped(encoded, grid.columns(), features, planeRows)};
  const HashGridBackward backward{
      grid,      {n, {}}, positions, table, Matrix<float>::grouped(upstream, grid.columns(), features, planeRows),
      gradients, {}};
  recorder.measure(kOperation<HashGridForward>, {"HashGridForward", where, lookups, "lookup", limit},
                   [&] { device.run(forward); });
  recorder.measure(kOperation<HashGridBackward>, {"HashGridBackward", where, lookups, "lookup", limit},
                   [&] { device.run(backward); });
}

// Lookups per second if every level is limited by the gather rate of a table of its size.
double gatherLimit(const MachineLimits& limits, const HashGrid& grid) {
  double seconds = 0;
  for (const HashGridLevel& level : grid.levels) {
    const size_t bytes = size_t{level.entries} * grid.features * sizeof(float);
    for (const MachineLimits::Gather& gather : limits.gathers) {
      if (gather.tableBytes == bytes) seconds += 1 / gather.lookups;
    }
  }
  return seconds > 0 ? static_cast<double>(grid.levels.size()) / seconds : 0;
}

}  // namespace

void measureNetworks(RooflineRecorder& recorder) {
  for (const uint32_t n : recorder.options().samples) {
    for (const int width : {16, 32, 64, 128}) {
      const MlpShape shape{width, width, 2, width, OutputActivation::none};
      measureNetwork(recorder, {shape, false}, fmt::format("{0}-{0}-{0}-{0}", width), n);
    }
    measureNetwork(recorder, {{32, 64, 1, 16, OutputActivation::none}, true}, "density 32-64-16", n);
    measureNetwork(recorder, {{32, 64, 2, 3, OutputActivation::sigmoid}, false}, "colour 32-64-64-3", n);
    measureDeferred(recorder, n);
  }
}

void measureHashGrids(RooflineRecorder& recorder, const HashGrid& grid) {
  const double limit = gatherLimit(recorder.limits(), grid);
  for (const uint32_t n : recorder.options().samples) {
    const Array<float> random = recorder.randomFloats(size_t{n} * 3, 0, 1);
    measureHashGrid(recorder, grid, "random points", recorder.device().read(random.all()), limit);
    measureHashGrid(recorder, grid, "points on rays", rayLikePositions(n / 32, 32, 1), limit);
  }
}

}  // namespace tessera
