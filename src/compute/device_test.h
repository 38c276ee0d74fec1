// What the walk over operation × device × shape needs: a stage on which one case sets up inputs and outputs on any
// device, and the table of cases. Each operation has one testsOf<Operation>() in a device_test_*.cpp; one that lacks it
// does not link.
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

inline constexpr float kPoison = -77777.125f;  // what no operation ever computes
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
  // [rays + 1], each ray having 0 to `most` samples.
  std::vector<uint32_t> firstSamples(size_t rays, uint32_t most);

 private:
  RandomStream stream_;
  uint64_t next_ = 0;
};

inline constexpr int64_t kNoCounter = -1;
struct Size {
  uint32_t capacity = 0;
  int64_t counter = kNoCounter;
  uint32_t first = 0;  // above 0: Count::first
  uint32_t used() const {
    return counter == kNoCounter || counter > capacity ? capacity : static_cast<uint32_t>(counter);
  }
};
std::string toString(const Size& size);

// Nothing, one, counters below, at zero and above the capacity, no multiples of vector widths, many tasks.
inline constexpr Size kSizes[] = {{0}, {1}, {5, 0}, {37}, {64, 50}, {130, 1000}, {1061}};
// Of operations that take part of the rows.
inline constexpr Size kRowSizes[] = {
    {0}, {1}, {5, 0}, {37}, {64, 50}, {130, 1000}, {1061}, {64, 50, 17}, {1061, 1000, 333}, {64, 20, 30}};
inline constexpr Size kSmallSizes[] = {{1}, {5, 0}, {37}, {130, 67}};

enum class Layout { plain, strided, grouped };  // grouped: two columns a plane

struct Output {
  std::string name;
  std::vector<float> values;
  std::vector<uint32_t> words;
  double tolerance = 0;  // of `values`, times the largest of them; 0: the same bits
};
using Outputs = std::vector<Output>;

// Inputs and outputs of one case on one device; owns their memory.
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
  Matrix<float> matrixOf(const std::vector<float>& values, uint32_t columns, Layout layout);  // values row-major

  // Poisoned unless `initial` is given; compared in full afterwards, gaps and all.
  Slice<float> output(std::string name, size_t size, double tolerance = 1e-5);
  Slice<float> output(std::string name, const std::vector<float>& initial, double tolerance = 1e-5);
  Slice<uint32_t> outputWords(std::string name, size_t size);
  Slice<uint32_t> outputWords(std::string name, const std::vector<uint32_t>& initial);
  Matrix<float> outputMatrix(std::string name, size_t rows, uint32_t columns, Layout layout, double tolerance = 1e-5);
  // Of what the device keeps in fp16 where Device::keepsHalves says so.
  Slice<float> keptInput(const std::vector<float>& values);
  Slice<float> keptOutput(std::string name, size_t size, double tolerance = 1e-5);

  Outputs outputs();  // waits for the device

 private:
  Matrix<float> shaped(Slice<float> buffer, size_t rows, uint32_t columns, Layout layout) const;
  static size_t sizeOf(size_t rows, uint32_t columns, Layout layout);

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

// Sets up inputs (from stage.random alone, so that every device gets the same) and runs the operation once.
struct Case {
  std::string name;
  std::function<void(Stage& stage)> run;
};

// One gradient: as the device says, and by central differences of the reference forward in double.
struct GradientPair {
  std::string name;
  std::vector<float> fromDevice;
  Doubles byDifferences;
  double tolerance = 1e-4;  // times the largest
};
struct GradientCase {
  std::string name;
  std::function<std::vector<GradientPair>(Stage& stage)> run;
};

struct OperationTests {
  std::vector<Case> cases;
  std::vector<GradientCase> gradients;
  std::string noGradient;  // why there is none to check
  // Which samples there are is decided in double: a device without may now and then decide otherwise.
  bool decides = false;
  // Some devices compute it in fp16: those are held to a hundredth.
  bool inHalves = false;
};

// Specialised for every operation, beside the cases of its kind; device_test.cpp knows the list.
template <class Arguments>
OperationTests testsOf();

// (f(x + h e_i) - f(x - h e_i)) / 2h for every i of `which`.
Doubles centralDifferences(const std::function<double(View)>& f, Doubles x, double h,
                           const std::vector<uint32_t>& which);
std::vector<uint32_t> firstIndices(size_t count);
std::vector<float> pick(const std::vector<float>& values, const std::vector<uint32_t>& which);
Doubles toDoubles(const std::vector<float>& values);
std::vector<float> toFloats(View values);
double dot(View a, View b);
// Apart from the order in which a device with atomics adds: every difference is at most 1e-5 of the largest.
void expectTheSameSums(const std::vector<float>& got, const std::vector<float>& wanted);

// The devices of this build, by name: "reference", "cpu with 1 thread", ... Null where this machine has none.
std::vector<std::string> deviceNames();
Device* deviceNamed(const std::string& name);
inline constexpr std::string_view kWithFallbacks = "vulkan without float atomics and subgroups";
inline constexpr std::string_view kWithoutDoubles = "vulkan without doubles";
// Those that compute OperationTests::inHalves. "Emulated": by the kernels of cooperative matrices, but without these,
// which Mesa's driver for the processor lacks.
std::vector<std::string> halfDeviceNames();
inline constexpr std::string_view kInHalves = "vulkan in halves", kWithMatrices = "vulkan with matrices",
                                  kWithEmulatedMatrices = "vulkan with emulated matrices";
bool computesInHalves(std::string_view name);
// The cpu device with each lesser instruction set that this machine has: "cpu AVX2 with 2 threads", ... All cpu devices
// share one set, so a test on a device first says which.
std::vector<std::string> lesserCpuNames();
void useSimdTargetOf(const std::string& name);  // the best where the name says none

}  // namespace tessera::device_test
