// What `tessera bench compute` times, by tiny-cuda-nn: networks and hash grids of the same shapes, by the interface of
// its PyTorch binding. Weights, activations and tables are fp16, inputs float. Names and shapes are those of the rows
// there.
//   tiny_cuda_nn OUT.json SAMPLES...
#include <cuda_runtime.h>
#include <tiny-cuda-nn/cpp_api.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <fstream>
#include <functional>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

namespace {

using nlohmann::json;

void check(cudaError_t result) {
  if (result != cudaSuccess) throw std::runtime_error(cudaGetErrorString(result));
}

// Device memory with random contents.
class Numbers {
 public:
  static Numbers floats(size_t count) {
    std::uniform_real_distribution<float> uniform(0, 1);
    std::vector<float> values(count);
    for (float& value : values) value = uniform(random());
    return Numbers(values.data(), count * sizeof(float));
  }
  // fp16 of either sign, from an eighth to a quarter.
  static Numbers halves(size_t count) {
    std::vector<uint16_t> values(count);
    for (uint16_t& value : values) value = static_cast<uint16_t>((random()() & 0x83ff) | 12 << 10);
    return Numbers(values.data(), count * sizeof(uint16_t));
  }
  ~Numbers() { cudaFree(memory_); }
  Numbers(const Numbers&) = delete;
  Numbers& operator=(const Numbers&) = delete;

  void* data() const { return memory_; }
  float* asFloats() const { return static_cast<float*>(memory_); }

 private:
  Numbers(const void* values, size_t bytes) {
    check(cudaMalloc(&memory_, bytes));
    check(cudaMemcpy(memory_, values, bytes, cudaMemcpyHostToDevice));
  }
  static std::mt19937& random() {
    static std::mt19937 generator(1);
    return generator;
  }
  void* memory_ = nullptr;
};

// The best of several, each of so many that beginning and waiting cost nothing.
double measureSeconds(cudaStream_t stream, const std::function<void()>& run) {
  cudaEvent_t begin, end;
  check(cudaEventCreate(&begin));
  check(cudaEventCreate(&end));
  const auto timed = [&](int times) {
    check(cudaEventRecord(begin, stream));
    for (int i = 0; i < times; ++i) run();
    check(cudaEventRecord(end, stream));
    check(cudaEventSynchronize(end));
    float milliseconds = 0;
    check(cudaEventElapsedTime(&milliseconds, begin, end));
    return 1e-3 * milliseconds;
  };
  int times = 1;
  timed(times);
  while (times < 1024 && timed(times) < 1e-2) times *= 2;
  double best = 1e30;
  for (int i = 0; i < 8; ++i) best = std::min(best, timed(times) / times);
  check(cudaEventDestroy(begin));
  check(cudaEventDestroy(end));
  return best;
}

void measure(json& rows, cudaStream_t stream, tcnn::cpp::Module& module, uint32_t samples, const std::string& name,
             const std::string& shape) {
  const Numbers input = Numbers::floats(size_t{samples} * module.n_input_dims());
  const Numbers inputGradients = Numbers::floats(size_t{samples} * module.n_input_dims());
  const Numbers output = Numbers::halves(size_t{samples} * module.n_output_dims());
  const Numbers outputGradients = Numbers::halves(size_t{samples} * module.n_output_dims());
  const Numbers parameters = Numbers::halves(module.n_params()), gradients = Numbers::halves(module.n_params());
  const bool isNetwork = name == "Mlp";
  const auto forward = [&] {
    return module.forward(stream, samples, input.asFloats(), output.data(), parameters.data(), isNetwork);
  };
  const auto backward = [&](const tcnn::cpp::Context& context) {
    module.backward(stream, context, samples, isNetwork ? inputGradients.asFloats() : nullptr, outputGradients.data(),
                    gradients.data(), input.asFloats(), output.data(), parameters.data());
  };
  const auto add = [&](const std::string& operation, const std::function<void()>& run) {
    const double seconds = measureSeconds(stream, run);
    std::printf("%-20s %-44s %9.4f ms\n", operation.c_str(), shape.c_str(), 1e3 * seconds);
    rows.push_back({{"operation", operation}, {"shape", shape}, {"seconds", seconds}});
  };
  add(name + "Forward", [&] { forward(); });
  const tcnn::cpp::Context context = forward();
  add(name + "Backward", [&] { backward(context); });
  if (isNetwork) add("Mlp both", [&] { backward(forward()); });
}

json networkConfig(int width, int hiddenLayers, const char* output) {
  return {{"otype", "FullyFusedMLP"},
          {"activation", "ReLU"},
          {"output_activation", output},
          {"n_neurons", width},
          {"n_hidden_layers", hiddenLayers}};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc < 3) throw std::runtime_error("usage: tiny_cuda_nn OUT.json SAMPLES...");
  if (tcnn::cpp::preferred_precision() != tcnn::cpp::Precision::Fp16) throw std::runtime_error("built without fp16");
  std::ofstream file(argv[1]);
  cudaDeviceProp gpu;
  check(cudaGetDeviceProperties(&gpu, 0));
  cudaStream_t stream;
  check(cudaStreamCreate(&stream));
  json rows = json::array();
  for (int i = 2; i < argc; ++i) {
    const uint32_t samples = static_cast<uint32_t>(std::stoul(argv[i]));
    if (samples == 0 || samples % tcnn::cpp::batch_size_granularity() != 0) {
      throw std::runtime_error("samples: multiples of " + std::to_string(tcnn::cpp::batch_size_granularity()));
    }
    const std::string count = ", " + std::to_string(samples) + " samples";
    const auto network = [&](const std::string& title, uint32_t inputs, uint32_t outputs, const json& layers) {
      const std::unique_ptr<tcnn::cpp::Module> module(tcnn::cpp::create_network(inputs, outputs, layers));
      measure(rows, stream, *module, samples, "Mlp", title + count);
    };
    for (const int width : {16, 32, 64, 128}) {
      const std::string one = std::to_string(width);
      network(one + "-" + one + "-" + one + "-" + one, static_cast<uint32_t>(width), static_cast<uint32_t>(width),
              networkConfig(width, 2, "None"));
    }
    network("density 32-64-16", 32, 16, networkConfig(64, 1, "None"));
    network("colour 32-64-64-3", 32, 3, networkConfig(64, 2, "Sigmoid"));
    const json grid = {{"otype", "HashGrid"},       {"n_levels", 16},
                       {"n_features_per_level", 2}, {"log2_hashmap_size", 17},
                       {"base_resolution", 16},     {"per_level_scale", std::pow(2048.0 / 16, 1.0 / 15)},
                       {"interpolation", "Linear"}};
    const std::unique_ptr<tcnn::cpp::Module> module(tcnn::cpp::create_encoding(3, grid, tcnn::cpp::Precision::Fp16));
    measure(rows, stream, *module, samples, "HashGrid", "16 levels x 2, random points" + count);
  }
  file << json{{"tiny_cuda_nn", {{"device", gpu.name}, {"operations", rows}}}}.dump(1) << "\n";
  file.close();
  if (!file) throw std::runtime_error(std::string(argv[1]) + ": cannot be written");
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "tiny_cuda_nn: %s\n", error.what());
  return 1;
}
