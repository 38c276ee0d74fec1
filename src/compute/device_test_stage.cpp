#include <fmt/format.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <numeric>

#include "base/error.h"
#include "compute/cpu/simd_targets.h"
#include "compute/device_test.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "gpu/context.h"
#endif

namespace tessera::device_test {

std::vector<float> Random::floats(size_t count, float low, float high) {
  std::vector<float> values(count);
  for (float& value : values) value = uniform(low, high);
  return values;
}

std::vector<float> Random::directions(size_t count) {
  std::vector<float> values;
  while (values.size() < 3 * count) {
    const float x = uniform(-1, 1), y = uniform(-1, 1), z = uniform(-1, 1);
    const float length = std::sqrt(x * x + y * y + z * z);
    if (length < 0.1f || length > 1) continue;
    for (float a : {x, y, z}) values.push_back(a / length);
  }
  return values;
}

std::vector<uint32_t> Random::wordsBelow(size_t count, uint32_t n) {
  std::vector<uint32_t> values(count);
  for (uint32_t& value : values) value = below(n);
  return values;
}

std::vector<uint32_t> Random::firstSamples(size_t rays, uint32_t maximum) {
  std::vector<uint32_t> first{0};
  for (size_t r = 0; r < rays; ++r) first.push_back(first.back() + (below(5) == 0 ? 0 : below(maximum + 1)));
  return first;
}

std::string toString(const Size& size) {
  if (size.counter == kNoCounter) return fmt::format("{}", size.capacity);
  if (size.first > 0) return fmt::format("from {} to counter {} of {}", size.first, size.counter, size.capacity);
  return fmt::format("counter {} of {}", size.counter, size.capacity);
}

Count Stage::count(const Size& size) {
  Count count;
  count.capacity = size.capacity;
  if (size.counter != kNoCounter) count.counter = input(std::vector<uint32_t>{static_cast<uint32_t>(size.counter)});
  if (size.first > 0) count.first = input(std::vector<uint32_t>{size.first});
  return count;
}

Slice<float> Stage::input(const std::vector<float>& values) {
  return floats_.emplace_back(device.uploadArray(values)).all();
}

Slice<uint32_t> Stage::input(const std::vector<uint32_t>& values) {
  return words_.emplace_back(device.uploadArray(values)).all();
}

size_t Stage::layoutSize(size_t rows, uint32_t columns, Layout layout) {
  switch (layout) {
    case Layout::plain:
      return rows * columns;
    case Layout::strided:
      return rows * (columns + 5);
    case Layout::grouped:
      return (rows + 3) * ((columns + 1) / 2 * 2);
  }
  return 0;
}

Matrix<float> Stage::shaped(Slice<float> buffer, size_t rows, uint32_t columns, Layout layout) const {
  switch (layout) {
    case Layout::plain:
      return {buffer, columns};
    case Layout::strided:
      return rows == 0 ? Matrix<float>(buffer, columns) : Matrix<float>(buffer, columns + 5).columnRange(3, columns);
    case Layout::grouped:
      return Matrix<float>::grouped(buffer, columns, 2, rows + 3);
  }
  return {};
}

Matrix<float> Stage::makeMatrix(const std::vector<float>& values, uint32_t columns, Layout layout) {
  const size_t rows = values.size() / columns;
  std::vector<float> placed(layoutSize(rows, columns, layout), kPoison);
  const Matrix<float> matrix = shaped(input(placed), rows, columns, layout);
  for (size_t i = 0; i < values.size(); ++i)
    placed[matrix.data.first + matrix.offset(i / columns, i % columns)] = values[i];
  if (!placed.empty()) device.write(floats_.back().all(), std::span<const float>(placed));
  return matrix;
}

Matrix<float> Stage::randomMatrix(size_t rows, uint32_t columns, Layout layout, float low, float high) {
  return makeMatrix(random.floats(rows * columns, low, high), columns, layout);
}

Slice<float> Stage::output(std::string name, size_t size, double tolerance) {
  return output(std::move(name), std::vector<float>(size, kPoison), tolerance);
}

Slice<float> Stage::output(std::string name, const std::vector<float>& initial, double tolerance) {
  const Slice<float> slice = input(initial);
  watched_.push_back({std::move(name), tolerance, slice, {}});
  return slice;
}

Slice<uint32_t> Stage::outputWords(std::string name, size_t size) {
  return outputWords(std::move(name), std::vector<uint32_t>(size, kPoisonWord));
}

Slice<uint32_t> Stage::outputWords(std::string name, const std::vector<uint32_t>& initial) {
  const Slice<uint32_t> slice = input(initial);
  watched_.push_back({std::move(name), 0, {}, slice});
  return slice;
}

Matrix<float> Stage::outputMatrix(std::string name, size_t rows, uint32_t columns, Layout layout, double tolerance) {
  return shaped(output(std::move(name), layoutSize(rows, columns, layout), tolerance), rows, columns, layout);
}

namespace {

// Rounds to the nearest fp16 value, ties to even; values that are too large become infinite.
uint16_t floatToHalf(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const auto sign = static_cast<uint16_t>(bits >> 16 & 0x8000u);
  const float size = std::abs(value);
  if (size >= 65520) return sign | 0x7c00u;
  const int exponent = std::max(std::ilogb(std::max(size, 1e-30f)), -14);
  // In units of the last bit; at least 1024 for normal numbers.
  const float steps = std::nearbyint(std::ldexp(size, 10 - exponent));
  return sign | static_cast<uint16_t>((exponent + 14) * 1024 + static_cast<int>(steps));
}

float halfToFloat(uint16_t half) {
  const int exponent = half >> 10 & 31, steps = half & 1023;
  const float size = exponent == 0    ? std::ldexp(static_cast<float>(steps), -24)
                     : exponent == 31 ? (steps == 0 ? INFINITY : NAN)
                                      : std::ldexp(static_cast<float>(1024 + steps), exponent - 25);
  return half >> 15 ? -size : size;
}

}  // namespace

Slice<float> Stage::keptInput(const std::vector<float>& values) {
  if (!device.storesActivationsInHalf()) return input(values);
  CHECK(values.size() % 2 == 0u);
  std::vector<float> pairs;
  for (size_t i = 0; i < values.size(); i += 2)
    pairs.push_back(
        std::bit_cast<float>(floatToHalf(values[i]) | static_cast<uint32_t>(floatToHalf(values[i + 1])) << 16));
  return input(pairs);
}

Slice<float> Stage::keptOutput(std::string name, size_t size, double tolerance) {
  if (!device.storesActivationsInHalf()) return output(std::move(name), size, tolerance);
  CHECK(size % 2 == 0u);
  const Slice<float> slice = input(std::vector<float>(size / 2, std::bit_cast<float>(kPoisonWord)));
  watched_.push_back({std::move(name), tolerance, slice, {}, true});
  return slice;
}

Outputs Stage::outputs() {
  device.finish();
  Outputs outputs;
  for (const Watched& watched : watched_) {
    Output output = {watched.name, device.read(watched.floats), device.read(watched.words), watched.tolerance};
    if (watched.halves) {
      std::vector<float> values;
      for (const float pair : output.values) {
        const auto word = std::bit_cast<uint32_t>(pair);
        for (const uint32_t shift : {0, 16}) {
          const auto half = static_cast<uint16_t>(word >> shift);
          values.push_back(half == static_cast<uint16_t>(kPoisonWord >> shift) ? kPoison : halfToFloat(half));
        }
      }
      output.values = std::move(values);
    }
    outputs.push_back(std::move(output));
  }
  return outputs;
}

Doubles centralDifferences(const std::function<double(View)>& f, Doubles x, double h,
                           const std::vector<uint32_t>& which) {
  Doubles slopes;
  for (uint32_t i : which) {
    const double original = x[i];
    x[i] = original + h;
    const double after = f(x);
    x[i] = original - h;
    const double before = f(x);
    x[i] = original;
    slopes.push_back((after - before) / (2 * h));
  }
  return slopes;
}

std::vector<uint32_t> firstIndices(size_t count) {
  std::vector<uint32_t> which(count);
  std::iota(which.begin(), which.end(), 0u);
  return which;
}

std::vector<float> pick(const std::vector<float>& values, const std::vector<uint32_t>& which) {
  std::vector<float> picked;
  for (uint32_t i : which) picked.push_back(values[i]);
  return picked;
}

Doubles toDoubles(const std::vector<float>& values) {
  return {values.begin(), values.end()};
}

std::vector<float> toFloats(View values) {
  std::vector<float> floats;
  for (double value : values) floats.push_back(static_cast<float>(value));
  return floats;
}

void expectTheSameSums(const std::vector<float>& actual, const std::vector<float>& expected) {
  ASSERT_EQ(actual.size(), expected.size());
  float largest = 0;
  for (const float value : expected) largest = std::max(largest, std::abs(value));
  for (size_t i = 0; i < expected.size(); ++i) EXPECT_NEAR(actual[i], expected[i], 1e-5 * largest) << i;
}

double dot(View a, View b) {
  CHECK(a.size() == b.size());
  return std::inner_product(a.begin(), a.end(), b.begin(), 0.0);
}

namespace {

std::unique_ptr<Device> openDevice(const std::string& name) {
#ifdef TESSERA_HAS_VULKAN
  if (name.starts_with("vulkan")) {
    GpuOptions options;
    options.allowed.floatAtomics = options.allowed.subgroups = name != kWithFallbacks;
    options.allowed.float64 = name != kWithoutDoubles;
    options.allowed.float16 = computesInHalves(name);
    options.allowed.matrices = name == kWithMatrices;
    const auto context = GpuContext::open(options);
    const GpuFeatures& features = context->features();
    if (features.float16 != options.allowed.float16 || features.matrices != options.allowed.matrices) {
      std::printf("no device \"%s\": %s has no such arithmetic\n", name.c_str(), context->name().c_str());
      return nullptr;
    }
    if (name == "vulkan") return makeVulkanDevice(options);
    // Dispatches few workgroups, each of which processes the work of several.
    return name == kWithEmulatedMatrices ? makeVulkanDeviceWithEmulatedMatrices(options, {})
                                         : makeVulkanDeviceWithFewGroups(options);
  }
#endif
  DeviceOptions options;
  options.kind = name.substr(0, name.find(' '));
  if (options.kind == "cpu") options.threads = name.find("1 thread") != std::string::npos ? 1 : 2;
  return makeDevice(options);
}

// With TESSERA_REQUIRE_VULKAN=1 in the environment, tests fail instead of being skipped on a machine without a driver.
bool mustBeThere(const std::string& name) {
  const char* required = std::getenv("TESSERA_REQUIRE_VULKAN");
  return !name.starts_with("vulkan") || (required != nullptr && std::string(required) == "1");
}

// "cpu AVX2 with 2 threads" → "AVX2"; empty if the name contains no instruction set.
std::string parseSimdTarget(const std::string& name) {
  const size_t begin = name.find(' ') + 1, end = name.find(" with ");
  return name.starts_with("cpu ") && begin < end ? name.substr(begin, end - begin) : std::string();
}

}  // namespace

std::vector<std::string> lesserCpuNames() {
  std::vector<std::string> names;
  for (const std::string& target : cpu::simdTargets()) names.push_back("cpu " + target + " with 2 threads");
  if (!names.empty()) names.erase(names.begin());  // cpu devices use the best one by default
  return names;
}

std::vector<std::string> deviceNames() {
  std::vector<std::string> names = {"reference", "cpu with 1 thread", "cpu with 2 threads"};
  for (std::string& name : lesserCpuNames()) names.push_back(std::move(name));
#ifdef TESSERA_HAS_VULKAN
  names.push_back("vulkan");
  names.emplace_back(kWithFallbacks);
  names.emplace_back(kWithoutDoubles);
#endif
  return names;
}

std::vector<std::string> halfDeviceNames() {
#ifdef TESSERA_HAS_VULKAN
  return {std::string(kInHalves), std::string(kWithMatrices), std::string(kWithEmulatedMatrices)};
#else
  return {};
#endif
}

bool computesInHalves(std::string_view name) {
  return name == kInHalves || name == kWithMatrices || name == kWithEmulatedMatrices;
}

void selectSimdTarget(const std::string& name) {
  cpu::useSimdTarget(parseSimdTarget(name));
}

namespace {

std::map<std::string, std::unique_ptr<Device>>& openDevices() {
  static std::map<std::string, std::unique_ptr<Device>> devices;
  return devices;
}

// Closes the devices before the process ends: drivers and layers that were loaded after the static map in `openDevices`
// was created are unloaded before it is destroyed.
class CloseDevices : public testing::Environment {
 public:
  void TearDown() override { openDevices().clear(); }
};
[[maybe_unused]] testing::Environment* const closeDevices = testing::AddGlobalTestEnvironment(new CloseDevices);

}  // namespace

Device* deviceNamed(const std::string& name) {
  const auto [it, isNew] = openDevices().try_emplace(name);
  if (isNew) {
    try {
      it->second = openDevice(name);
    } catch (const Error& error) {
      if (mustBeThere(name)) throw;
      std::printf("no device \"%s\": %s\n", name.c_str(), error.what());
    }
  }
  return it->second.get();
}

}  // namespace tessera::device_test
