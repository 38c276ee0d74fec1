// Helpers of the test of every operation on every device with many shapes: a stage, on which a case sets up its inputs
// and outputs on any device, and the table of cases. Each operation has one makeTests<Operation>() in a
// device_test_*.cpp; an operation without it does not link.
#pragma once

#include <deque>
#include <functional>
#include <string>
#include <vector>

#include "base/random.h"
#include "compute/device.h"
#include "compute/reference/functions.h"

namespace tessera::device_test {

using reference::Doubles;
using reference::View;

inline constexpr float kPoison = -77777.125f;  // a value that no operation ever computes
inline constexpr uint32_t kPoisonWord = 0xdeadbeefu;

class Random {
 public:
  explicit Random(uint64_t seed) : stream_(seed, 0x7e57) {}
  float uniform(float low, float high) { return low + (high - low) * stream_.uniform(next_++); }
  uint32_t below(uint32_t n) { return stream_.below(next_++, n); }
  uint32_t bits() { return stream_.bits32(next_++); }
  std::vector<float> floats(size_t count, float low, float high);
  std::vector<float> directions(size_t count);  // unit, [count][3]
  std::vector<uint32_t> wordsBelow(size_t count, uint32_t n);
  // [rays + 1]; each ray has 0 to `maximum` samples.
  std::vector<uint32_t> firstSamples(size_t rays, uint32_t maximum);

 private:
  RandomStream stream_;
  uint64_t next_ = 0;
};

inline constexpr int64_t kNoCounter = -1;
struct Size {
  uint32_t capacity = 0;
  int64_t counter = kNoCounter;
  uint32_t first = 0;  // Count::first, if above 0
  uint32_t used() const {
    return counter == kNoCounter || counter > capacity ? capacity : static_cast<uint32_t>(counter);
  }
};
std::string toString(const Size& size);

// No element, one, counters at zero, below and above the capacity, sizes that are no multiples of the vector width, and
// enough elements for many tasks.
inline constexpr Size kSizes[] = {{0}, {1}, {5, 0}, {37}, {64, 50}, {130, 1000}, {1061}};
// Sizes for operations that can work on part of the rows.
inline constexpr Size kRowSizes[] = {
    {0}, {1}, {5, 0}, {37}, {64, 50}, {130, 1000}, {1061}, {64, 50, 17}, {1061, 1000, 333}, {64, 20, 30}};
inline constexpr Size kSmallSizes[] = {{1}, {5, 0}, {37}, {130, 67}};

enum class Layout { plain, strided, grouped };  // grouped: two columns per plane

struct Output {
  std::string name;
  std::vector<float> values;
  std::vector<uint32_t> words;
  double tolerance = 0;  // maximum difference relative to the largest of `values`; 0: the same bits
};
using Outputs = std::vector<Output>;

// The inputs and outputs of one case on one device; owns their memory.
class Stage {
 public:
  Stage(Device& onDevice, uint64_t seed) : device(onDevice), random(seed) {}

  Device& device;
  Random random;

  Count count(const Size& size);
  Slice<float> input(const std::vector<float>& values);
  Slice<uint32_t> input(const std::vector<uint32_t>& values);
  Slice<float> randomInput(size_t size, float low, float high) { return input(random.floats(size, low, high)); }
  Matrix<float> randomMatrix(size_t rows, uint32_t columns, Layout layout, float low, float high);
  Matrix<float> makeMatrix(const std::vector<float>& values, uint32_t columns, Layout layout);  // values row-major

  // Outputs are filled with poison unless `initial` is given. They are compared in full afterwards, including gaps.
  Slice<float> output(std::string name, size_t size, double tolerance = 1e-5);
  Slice<float> output(std::string name, const std::vector<float>& initial, double tolerance = 1e-5);
  Slice<uint32_t> outputWords(std::string name, size_t size);
  Slice<uint32_t> outputWords(std::string name, const std::vector<uint32_t>& initial);
  Matrix<float> outputMatrix(std::string name, size_t rows, uint32_t columns, Layout layout, double tolerance = 1e-5);
  // Activations, which are in fp16 if Device::storesActivationsInHalf.
  Slice<float> keptInput(const std::vector<float>& values);
  Slice<float> keptOutput(std::string name, size_t size, double tolerance = 1e-5);

  Outputs outputs();  // waits for the device

 private:
  Matrix<float> shaped(Slice<float> buffer, size_t rows, uint32_t columns, Layout layout) const;
  static size_t layoutSize(size_t rows, uint32_t columns, Layout layout);

  std::deque<Array<float>> floats_;
  std::deque<Array<uint32_t>> words_;
  struct Watched {
    std::string name;
    double tolerance;
    Slice<const float> floats;
    Slice<const uint32_t> words;
    bool halves = false;  // `words` are pairs of fp16
  };
  std::vector<Watched> watched_;
};

// Sets up the inputs, from stage.random alone so that every device gets the same, and runs the operation once.
struct Case {
  std::string name;
  std::function<void(Stage& stage)> run;
};

// One gradient: as computed by the device, and by central differences of the reference forward function in double.
struct GradientPair {
  std::string name;
  std::vector<float> fromDevice;
  Doubles byDifferences;
  double tolerance = 1e-4;  // relative to the largest element
};
struct GradientCase {
  std::string name;
  std::function<std::vector<GradientPair>(Stage& stage)> run;
};

struct OperationTests {
  std::vector<Case> cases;
  std::vector<GradientCase> gradients;
  std::string noGradient;  // why there is no gradient to check
  // The operation decides in double which samples exist; a device without doubles may decide differently for a few.
  bool decides = false;
  // Some devices compute the operation in fp16; their results may differ by a hundredth.
  bool inHalves = false;
};

// Specialised for every operation in the device_test_*.cpp of its kind; device_test.cpp has the list of operations.
template <class Arguments>
OperationTests makeTests();

// (f(x + h e_i) - f(x - h e_i)) / 2h for every i of `which`.
Doubles centralDifferences(const std::function<double(View)>& f, Doubles x, double h,
                           const std::vector<uint32_t>& which);
std::vector<uint32_t> firstIndices(size_t count);
std::vector<float> pick(const std::vector<float>& values, const std::vector<uint32_t>& which);
Doubles toDoubles(const std::vector<float>& values);
std::vector<float> toFloats(View values);
double dot(View a, View b);
// Expects sums to be equal except for the order in which a device with atomics adds: every difference is at most 1e-5
// of the largest value.
void expectTheSameSums(const std::vector<float>& actual, const std::vector<float>& expected);

// The names of the devices of this build: "reference", "cpu with 1 thread", ...
std::vector<std::string> deviceNames();
Device* deviceNamed(const std::string& name);  // null if this machine has no such device; open until the tests end
inline constexpr std::string_view kWithFallbacks = "vulkan without float atomics and subgroups";
inline constexpr std::string_view kWithoutDoubles = "vulkan without doubles";
// The devices that compute the operations with OperationTests::inHalves in fp16. "Emulated" uses the kernels for
// cooperative matrices, but emulates these matrices, which Mesa's driver for the CPU lacks.
std::vector<std::string> halfDeviceNames();
inline constexpr std::string_view kInHalves = "vulkan in halves", kWithMatrices = "vulkan with matrices",
                                  kWithEmulatedMatrices = "vulkan with emulated matrices";
bool computesInHalves(std::string_view name);
// The cpu device with each instruction set of this machine except the best: "cpu AVX2 with 2 threads", ... All cpu
// devices share one instruction set, so a test must select the one of its device first.
std::vector<std::string> lesserCpuNames();
void selectSimdTarget(const std::string& name);  // selects the best if the device name contains none

}  // namespace tessera::device_test
