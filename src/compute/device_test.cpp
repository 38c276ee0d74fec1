// Tests every operation on every device with many shapes: results agree with the reference, gradients agree with finite
// differences of the reference forward function in double, and the cpu device computes the same bits with 1 and 2
// threads.
#include "compute/device_test.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <set>

#include "compute/operations.h"
#ifdef TESSERA_HAS_VULKAN
#include "compute/vulkan/device.h"
#include "gpu/context.h"
#endif

namespace tessera {

struct UnlistedOperation {};
TESSERA_OPERATION(UnlistedOperation);

}  // namespace tessera

namespace tessera::device_test {

#define TESSERA_DECLARE(name) \
  template <>                 \
  OperationTests makeTests<name>();
TESSERA_OPERATIONS(TESSERA_DECLARE)
#undef TESSERA_DECLARE

namespace {

struct Row {
  OperationId operation;
  OperationTests (*tests)();
};

void PrintTo(const Row& row, std::ostream* out) {
  *out << row.operation.name();
}

constexpr Row kRows[] = {
#define TESSERA_ROW(name) {kOperation<name>, makeTests<name>},
    TESSERA_OPERATIONS(TESSERA_ROW)
#undef TESSERA_ROW
};

std::string_view operationName(const OperationId& operation) {
  return operation.name();
}

uint64_t operationSeed(const OperationId& operation, size_t caseIndex) {
  const auto place = std::find(std::begin(kAllOperations), std::end(kAllOperations), operation);
  return 1000 * (1 + static_cast<uint64_t>(place - std::begin(kAllOperations))) + caseIndex;
}

uint32_t toBits(float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits;
}

// Describes the first difference between two outputs; empty if they agree. With `exact`, all bits must be equal.
std::string difference(const Output& actual, const Output& expected, bool exact) {
  if (actual.values.size() != expected.values.size() || actual.words.size() != expected.words.size())
    return "sizes differ";
  for (size_t i = 0; i < expected.words.size(); ++i)
    if (actual.words[i] != expected.words[i])
      return fmt::format("{}[{}] is {} instead of {}", expected.name, i, actual.words[i], expected.words[i]);
  double largest = 1e-3;
  for (float value : expected.values)
    if (value != kPoison) largest = std::max<double>(largest, std::abs(value));
  for (size_t i = 0; i < expected.values.size(); ++i) {
    const float a = actual.values[i], b = expected.values[i];
    const bool same = exact || expected.tolerance == 0 || b == kPoison
                          ? toBits(a) == toBits(b)
                          : std::abs(a - b) <= expected.tolerance * largest;
    if (!same)
      return fmt::format("{}[{}] is {} instead of {} (largest {}, tolerance {})", expected.name, i, a,
                         b == kPoison ? "untouched" : fmt::format("{}", b), largest, expected.tolerance);
  }
  return {};
}

constexpr double kHalfTolerance = 1e-2;

// How much outputs may differ from those of the reference.
enum class Closeness {
  exact,     // the same bits
  close,     // the tolerance of each output
  inFloat,   // that tolerance, but at least 1e-4 of the largest value
  inHalves,  // that tolerance, but at least kHalfTolerance of the largest value
  mostly,    // the same samples to a thousandth, except for a few percent of them
};

constexpr double kFewShare = 0.03;

bool isFew(double count, double all) {
  return count <= 3 + kFewShare * all;
}

const Output* outputNamed(const Outputs& outputs, std::string_view name) {
  const auto it = std::find_if(outputs.begin(), outputs.end(), [&](const Output& one) { return one.name == name; });
  return it == outputs.end() ? nullptr : &*it;
}

// Compares the outputs of operations that decide which samples exist. Empty if all but a few of the counts are the
// same, and all but a few of the samples on rays with equal counts.
std::string differenceOfSamples(const Outputs& actual, const Outputs& expected) {
  for (size_t i = 0; i < expected.size(); ++i) {
    if (expected[i].words.size() != 1) continue;
    const double a = actual[i].words[0], b = expected[i].words[0];
    if (!isFew(std::abs(a - b), b)) return fmt::format("{} is {} instead of {}", expected[i].name, a, b);
  }
  const std::vector<uint32_t>&begins = outputNamed(actual, "firstSample")->words,
        &expectedBegins = outputNamed(expected, "firstSample")->words;
  const size_t capacity = outputNamed(expected, "distances")->values.size();
  size_t rays = 0, otherRays = 0, rows = 0, otherRows = 0;
  std::string first;
  for (size_t ray = 0; ray + 1 < begins.size(); ++ray) {
    const size_t begin = begins[ray], expectedBegin = expectedBegins[ray],
                 count = expectedBegins[ray + 1] - expectedBegin;
    if (expectedBegins[ray + 1] > capacity) break;  // the remaining rays are not in use
    ++rays;
    if (begins[ray + 1] - begin != count) {
      ++otherRays;
      continue;
    }
    for (size_t i = 0; i < expected.size(); ++i) {
      const Output &a = actual[i], &b = expected[i];
      const bool ofSamples = a.name == "positions" || a.name == "distances" || a.name == "steps" ||
                             a.name == "middles" || a.name == "widths" || a.name == "runtimeSteps" ||
                             a.name == "barycentrics";
      const bool names =
          a.name == "rayOfSample" || a.name == "faces" || a.name == "slotOfSample" || a.name == "blockOfSample";
      const size_t columns = ofSamples ? b.values.size() / capacity : names ? 1 : 0;
      for (size_t row = 0; row < count * columns; ++row) {
        const size_t place = begin * columns + row, expectedPlace = expectedBegin * columns + row;
        ++rows;
        const bool same = names ? a.words[place] == b.words[expectedPlace]
                                : std::abs(a.values[place] - b.values[expectedPlace]) <=
                                      1e-3 * std::max(1.0f, std::abs(b.values[expectedPlace]));
        if (!same && first.empty()) first = fmt::format("{}[{}] of ray {}", b.name, row, ray);
        otherRows += !same;
      }
    }
  }
  if (!isFew(otherRays, rays)) return fmt::format("{} of {} rays have other numbers of samples", otherRays, rays);
  if (!isFew(otherRows, rows)) return fmt::format("{} of {} numbers differ, first {}", otherRows, rows, first);
  return {};
}

void compare(const Outputs& actual, Outputs expected, Closeness closeness, const std::string& what) {
  ASSERT_EQ(actual.size(), expected.size());
  if (closeness == Closeness::mostly) {
    EXPECT_EQ(differenceOfSamples(actual, expected), "") << what;
    return;
  }
  for (size_t i = 0; i < expected.size(); ++i) {
    const double minimum = closeness == Closeness::inHalves  ? kHalfTolerance
                           : closeness == Closeness::inFloat ? 1e-4
                                                             : 0;
    if (expected[i].tolerance > 0) expected[i].tolerance = std::max(expected[i].tolerance, minimum);
    EXPECT_EQ(difference(actual[i], expected[i], closeness == Closeness::exact), "") << what;
  }
}

Outputs computeOutputs(const Case& testCase, Device& device, uint64_t seed) {
  Stage stage(device, seed);
  testCase.run(stage);
  return stage.outputs();
}

using OperationOnDevice = std::tuple<Row, std::string>;

// Whether the device is a real GPU, whose exponentials and divisions may be off by several units in the last place, and
// not a Vulkan driver for the CPU.
bool isOnAGpu([[maybe_unused]] const Device& device) {
#ifdef TESSERA_HAS_VULKAN
  if (const auto context = vulkanContext(device)) return !context->isCpu();
#endif
  return false;
}

class DeviceTest : public testing::TestWithParam<OperationOnDevice> {
 protected:
  void SetUp() override {
    const auto& [row, name] = GetParam();
    selectSimdTarget(name);
    operation = row.operation;
    tests = row.tests();
    device = deviceNamed(name);
    if (device == nullptr) GTEST_SKIP() << "this machine has no device \"" << name << "\"";
  }

  void TearDown() override {
    selectSimdTarget({});
#ifdef TESSERA_HAS_VULKAN
    EXPECT_EQ(GpuContext::validationMessages(), 0);
#endif
  }

  OperationId operation{""};
  OperationTests tests;
  Device* device = nullptr;
};

class Values : public DeviceTest {};
class Gradients : public DeviceTest {};
class Threads : public DeviceTest {};

TEST_P(Values, AgreeWithTheReference) {
  ASSERT_FALSE(tests.cases.empty());
  Closeness closeness = Closeness::close;
  if (computesInHalves(std::get<1>(GetParam()))) closeness = Closeness::inHalves;
  if (isOnAGpu(*device)) closeness = std::max(closeness, Closeness::inFloat);
  if (std::get<1>(GetParam()) == kWithoutDoubles) closeness = tests.decides ? Closeness::mostly : Closeness::inFloat;
  for (size_t i = 0; i < tests.cases.size(); ++i) {
    const uint64_t seed = operationSeed(operation, i);
    const Case& testCase = tests.cases[i];
    compare(computeOutputs(testCase, *device, seed), computeOutputs(testCase, *deviceNamed("reference"), seed),
            closeness, fmt::format("{}, {}, seed {}", operationName(operation), testCase.name, seed));
  }
}

TEST_P(Gradients, AgreeWithFiniteDifferences) {
  const double minimum = computesInHalves(std::get<1>(GetParam())) ? kHalfTolerance : 0;
  for (size_t i = 0; i < tests.gradients.size(); ++i) {
    const uint64_t seed = operationSeed(operation, 500 + i);
    Stage stage(*device, seed);
    for (const GradientPair& pair : tests.gradients[i].run(stage)) {
      ASSERT_EQ(pair.fromDevice.size(), pair.byDifferences.size());
      double largest = 0;
      for (double slope : pair.byDifferences) largest = std::max(largest, std::abs(slope));
      EXPECT_GT(largest, 0) << "nothing to compare in " << pair.name;
      for (size_t k = 0; k < pair.fromDevice.size(); ++k)
        EXPECT_NEAR(pair.fromDevice[k], pair.byDifferences[k], std::max(pair.tolerance, minimum) * largest)
            << tests.gradients[i].name << ", " << pair.name << "[" << k << "], seed " << seed;
    }
  }
}

TEST_P(Threads, NeverChangeABit) {
  for (size_t i = 0; i < tests.cases.size(); ++i) {
    const uint64_t seed = operationSeed(operation, i);
    compare(computeOutputs(tests.cases[i], *device, seed),
            computeOutputs(tests.cases[i], *deviceNamed("cpu with 1 thread"), seed), Closeness::exact,
            fmt::format("{}, {}, seed {}", operationName(operation), tests.cases[i].name, seed));
  }
}

std::vector<OperationOnDevice> rows(bool needsGradient, const std::vector<std::string>& devices) {
  std::vector<OperationOnDevice> chosen;
  for (const Row& row : kRows)
    for (const std::string& device : devices)
      if ((!needsGradient || !row.tests().gradients.empty()) && (!computesInHalves(device) || row.tests().inHalves))
        chosen.emplace_back(row, device);
  return chosen;
}

std::vector<std::string> withHalfDevices(std::vector<std::string> names) {
  for (std::string& name : halfDeviceNames()) names.push_back(std::move(name));
  return names;
}

std::vector<std::string> devicesButTheReference() {
  std::vector<std::string> names = deviceNames();
  std::erase(names, "reference");
  return names;
}

std::vector<std::string> cpusWithTwoThreads() {
  std::vector<std::string> names = lesserCpuNames();
  names.push_back("cpu with 2 threads");
  return names;
}

std::string testName(const testing::TestParamInfo<OperationOnDevice>& info) {
  std::string name = fmt::format("{}_{}", operationName(std::get<0>(info.param).operation), std::get<1>(info.param));
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
}

INSTANTIATE_TEST_SUITE_P(Device, Values, testing::ValuesIn(rows(false, withHalfDevices(devicesButTheReference()))),
                         testName);
INSTANTIATE_TEST_SUITE_P(Device, Gradients, testing::ValuesIn(rows(true, withHalfDevices(deviceNames()))), testName);
INSTANTIATE_TEST_SUITE_P(Device, Threads, testing::ValuesIn(rows(false, cpusWithTwoThreads())), testName);

TEST(Operations, HaveAGradientToCheckOrAReasonForNone) {
  for (const Row& row : kRows) {
    const OperationTests tests = row.tests();
    EXPECT_NE(tests.gradients.empty(), tests.noGradient.empty()) << operationName(row.operation);
    if (tests.gradients.empty())
      std::printf("%s has no gradient: %s\n", std::string(operationName(row.operation)).c_str(),
                  tests.noGradient.c_str());
  }
}

TEST(Devices, RunTheKernelsOfEachInstructionSetThatTheMachineHas) {
  std::set<std::string> targets = {deviceNamed("cpu with 2 threads")->target()};
  for (const std::string& name : lesserCpuNames()) {
    selectSimdTarget(name);
    const std::string target = deviceNamed(name)->target();
    EXPECT_EQ(name, "cpu " + target.substr(target.find('/') + 1) + " with 2 threads");
    EXPECT_TRUE(targets.insert(target).second) << target;
  }
  selectSimdTarget({});
  EXPECT_TRUE(targets.contains(deviceNamed("cpu with 2 threads")->target()));
}

// A device that has memory and records the requested operations without running them.
class IdleDevice final : public Device {
 public:
  std::vector<OperationId> asked;

  std::string name() const override { return "idle"; }
  std::string target() const override { return "idle"; }
  std::unique_ptr<Memory> allocate(size_t bytes) override { return host_.allocate(bytes); }
  void writeBytes(Memory& to, size_t offset, std::span<const std::byte> from) override {
    host_.writeBytes(to, offset, from);
  }
  void readBytes(std::span<const Reading> readings) override { host_.readBytes(readings); }
  using Device::fillZero;
  void fillZero(Memory& memory, size_t offset, size_t bytes) override { host_.fillZero(memory, offset, bytes); }
  void finish() override {}

 private:
  bool runOperation(const OperationId& operation, const void*) override {
    asked.push_back(operation);
    return true;
  }

  Device& host_ = *deviceNamed("reference");
};

// Whether the outputs of at least one case differ from their initial contents.
bool writesSomething(const Row& row, Device& device) {
  const OperationTests tests = row.tests();
  for (size_t i = 0; i < tests.cases.size(); ++i) {
    const uint64_t seed = operationSeed(row.operation, i);
    IdleDevice idle;
    const Outputs before = computeOutputs(tests.cases[i], idle, seed),
                  after = computeOutputs(tests.cases[i], device, seed);
    EXPECT_EQ(idle.asked, std::vector<OperationId>{row.operation}) << tests.cases[i].name;
    for (size_t k = 0; k < after.size(); ++k)
      if (!difference(after[k], before[k], true).empty()) return true;
  }
  return false;
}

TEST(Devices, RunEveryOperation) {
  for (const std::string& name : deviceNames()) {
    selectSimdTarget(name);
    Device* const device = deviceNamed(name);
    if (device == nullptr) continue;
    for (const Row& row : kRows)
      EXPECT_TRUE(writesSomething(row, *device)) << name << ", " << operationName(row.operation);
  }
  selectSimdTarget({});
  EXPECT_NE(deviceNamed("reference"), nullptr);
  EXPECT_NE(deviceNamed("cpu with 1 thread"), nullptr);
}

TEST(DevicesDeathTest, NameAnOperationThatTheyLack) {
  for (const std::string& name : deviceNames()) {
    selectSimdTarget(name);
    Device* const device = deviceNamed(name);
    if (device == nullptr) continue;
    EXPECT_DEATH(device->run(UnlistedOperation()), "has no operation UnlistedOperation") << name;
  }
  selectSimdTarget({});
}

}  // namespace
}  // namespace tessera::device_test
