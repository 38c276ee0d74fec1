// Walks operation × device × shape: agrees with the reference; gradient agrees with finite differences of the reference
// forward in double; on the cpu the same bits for 1 and 2 threads.
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
  OperationTests testsOf<name>();
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
#define TESSERA_ROW(name) {kOperation<name>, testsOf<name>},
    TESSERA_OPERATIONS(TESSERA_ROW)
#undef TESSERA_ROW
};

std::string_view nameOf(const OperationId& operation) {
  return operation.name();
}

uint64_t seedOf(const OperationId& operation, size_t caseIndex) {
  const auto place = std::find(std::begin(kAllOperations), std::end(kAllOperations), operation);
  return 1000 * (1 + static_cast<uint64_t>(place - std::begin(kAllOperations))) + caseIndex;
}

uint32_t bitsOf(float value) {
  uint32_t bits;
  std::memcpy(&bits, &value, sizeof(bits));
  return bits;
}

// Empty when they agree. With `exact` the bits of everything must be equal.
std::string difference(const Output& got, const Output& want, bool exact) {
  if (got.values.size() != want.values.size() || got.words.size() != want.words.size()) return "sizes differ";
  for (size_t i = 0; i < want.words.size(); ++i)
    if (got.words[i] != want.words[i])
      return fmt::format("{}[{}] is {} instead of {}", want.name, i, got.words[i], want.words[i]);
  double largest = 1e-3;
  for (float value : want.values)
    if (value != kPoison) largest = std::max<double>(largest, std::abs(value));
  for (size_t i = 0; i < want.values.size(); ++i) {
    const float a = got.values[i], b = want.values[i];
    const bool same = exact || want.tolerance == 0 || b == kPoison ? bitsOf(a) == bitsOf(b)
                                                                   : std::abs(a - b) <= want.tolerance * largest;
    if (!same)
      return fmt::format("{}[{}] is {} instead of {} (largest {}, tolerance {})", want.name, i, a,
                         b == kPoison ? "untouched" : fmt::format("{}", b), largest, want.tolerance);
  }
  return {};
}

constexpr double kHalfTolerance = 1e-2;

// How far outputs may be from those of the reference.
enum class Closeness {
  exact,     // the same bits
  close,     // as each output says
  inFloat,   // or 1e-4 of the largest, where that is more
  inHalves,  // or a hundredth of it
  mostly,    // the same samples to a thousandth, but for a few of a hundred
};

constexpr double kFewShare = 0.03;

bool isFew(double count, double all) {
  return count <= 3 + kFewShare * all;
}

const Output* outputNamed(const Outputs& outputs, std::string_view name) {
  const auto found = std::find_if(outputs.begin(), outputs.end(), [&](const Output& one) { return one.name == name; });
  return found == outputs.end() ? nullptr : &*found;
}

// Of operations that decide which samples there are: empty when counts, and the samples of rays that have as many of
// them, are the same but for a few.
std::string differenceOfSamples(const Outputs& got, const Outputs& want) {
  for (size_t i = 0; i < want.size(); ++i) {
    if (want[i].words.size() != 1) continue;
    const double a = got[i].words[0], b = want[i].words[0];
    if (!isFew(std::abs(a - b), b)) return fmt::format("{} is {} instead of {}", want[i].name, a, b);
  }
  const std::vector<uint32_t>&begins = outputNamed(got, "firstSample")->words,
        &wantedBegins = outputNamed(want, "firstSample")->words;
  const size_t capacity = outputNamed(want, "distances")->values.size();
  size_t rays = 0, otherRays = 0, rows = 0, otherRows = 0;
  std::string first;
  for (size_t ray = 0; ray + 1 < begins.size(); ++ray) {
    const size_t begin = begins[ray], wanted = wantedBegins[ray], count = wantedBegins[ray + 1] - wanted;
    if (wantedBegins[ray + 1] > capacity) break;  // rays that are not in use
    ++rays;
    if (begins[ray + 1] - begin != count) {
      ++otherRays;
      continue;
    }
    for (size_t i = 0; i < want.size(); ++i) {
      const Output &a = got[i], &b = want[i];
      const bool ofSamples = a.name == "positions" || a.name == "distances" || a.name == "steps" ||
                             a.name == "middles" || a.name == "widths" || a.name == "runtimeSteps";
      const bool names = a.name == "rayOfSample" || a.name == "slotOfSample" || a.name == "blockOfSample";
      const size_t columns = ofSamples ? b.values.size() / capacity : names ? 1 : 0;
      for (size_t row = 0; row < count * columns; ++row) {
        const size_t place = begin * columns + row, wantedPlace = wanted * columns + row;
        ++rows;
        const bool same = names ? a.words[place] == b.words[wantedPlace]
                                : std::abs(a.values[place] - b.values[wantedPlace]) <=
                                      1e-3 * std::max(1.0f, std::abs(b.values[wantedPlace]));
        if (!same && first.empty()) first = fmt::format("{}[{}] of ray {}", b.name, row, ray);
        otherRows += !same;
      }
    }
  }
  if (!isFew(otherRays, rays)) return fmt::format("{} of {} rays have other numbers of samples", otherRays, rays);
  if (!isFew(otherRows, rows)) return fmt::format("{} of {} numbers differ, first {}", otherRows, rows, first);
  return {};
}

void compare(const Outputs& got, Outputs want, Closeness closeness, const std::string& what) {
  ASSERT_EQ(got.size(), want.size());
  if (closeness == Closeness::mostly) {
    EXPECT_EQ(differenceOfSamples(got, want), "") << what;
    return;
  }
  for (size_t i = 0; i < want.size(); ++i) {
    const double least = closeness == Closeness::inHalves ? kHalfTolerance : closeness == Closeness::inFloat ? 1e-4 : 0;
    if (want[i].tolerance > 0) want[i].tolerance = std::max(want[i].tolerance, least);
    EXPECT_EQ(difference(got[i], want[i], closeness == Closeness::exact), "") << what;
  }
}

Outputs outputsOf(const Case& testCase, Device& device, uint64_t seed) {
  Stage stage(device, seed);
  testCase.run(stage);
  return stage.outputs();
}

using OperationOnDevice = std::tuple<Row, std::string>;

// Not by a driver for the processor: then exponentials and divisions may be several units in the last place off.
bool isOnACard([[maybe_unused]] const Device& device) {
#ifdef TESSERA_HAS_VULKAN
  if (const auto context = contextOf(device)) return !context->isProcessor();
#endif
  return false;
}

class DeviceTest : public testing::TestWithParam<OperationOnDevice> {
 protected:
  void SetUp() override {
    const auto& [row, name] = GetParam();
    useSimdTargetOf(name);
    operation = row.operation;
    tests = row.tests();
    device = deviceNamed(name);
    if (device == nullptr) GTEST_SKIP() << "this machine has no device \"" << name << "\"";
  }

  void TearDown() override {
    useSimdTargetOf({});
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
  if (isOnACard(*device)) closeness = std::max(closeness, Closeness::inFloat);
  if (std::get<1>(GetParam()) == kWithoutDoubles) closeness = tests.decides ? Closeness::mostly : Closeness::inFloat;
  for (size_t i = 0; i < tests.cases.size(); ++i) {
    const uint64_t seed = seedOf(operation, i);
    const Case& testCase = tests.cases[i];
    compare(outputsOf(testCase, *device, seed), outputsOf(testCase, *deviceNamed("reference"), seed), closeness,
            fmt::format("{}, {}, seed {}", nameOf(operation), testCase.name, seed));
  }
}

TEST_P(Gradients, AreThoseOfFiniteDifferences) {
  const double least = computesInHalves(std::get<1>(GetParam())) ? kHalfTolerance : 0;
  for (size_t i = 0; i < tests.gradients.size(); ++i) {
    const uint64_t seed = seedOf(operation, 500 + i);
    Stage stage(*device, seed);
    for (const GradientPair& pair : tests.gradients[i].run(stage)) {
      ASSERT_EQ(pair.fromDevice.size(), pair.byDifferences.size());
      double largest = 0;
      for (double slope : pair.byDifferences) largest = std::max(largest, std::abs(slope));
      EXPECT_GT(largest, 0) << "nothing to compare in " << pair.name;
      for (size_t k = 0; k < pair.fromDevice.size(); ++k)
        EXPECT_NEAR(pair.fromDevice[k], pair.byDifferences[k], std::max(pair.tolerance, least) * largest)
            << tests.gradients[i].name << ", " << pair.name << "[" << k << "], seed " << seed;
    }
  }
}

TEST_P(Threads, NeverChangeABit) {
  for (size_t i = 0; i < tests.cases.size(); ++i) {
    const uint64_t seed = seedOf(operation, i);
    compare(outputsOf(tests.cases[i], *device, seed),
            outputsOf(tests.cases[i], *deviceNamed("cpu with 1 thread"), seed), Closeness::exact,
            fmt::format("{}, {}, seed {}", nameOf(operation), tests.cases[i].name, seed));
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
  std::string name = fmt::format("{}_{}", nameOf(std::get<0>(info.param).operation), std::get<1>(info.param));
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
    EXPECT_NE(tests.gradients.empty(), tests.noGradient.empty()) << nameOf(row.operation);
    if (tests.gradients.empty())
      std::printf("%s has no gradient: %s\n", std::string(nameOf(row.operation)).c_str(), tests.noGradient.c_str());
  }
}

TEST(Devices, RunTheKernelsOfEachInstructionSetThatTheMachineHas) {
  std::set<std::string> targets = {deviceNamed("cpu with 2 threads")->target()};
  for (const std::string& name : lesserCpuNames()) {
    useSimdTargetOf(name);
    const std::string target = deviceNamed(name)->target();
    EXPECT_EQ(name, "cpu " + target.substr(target.find('/') + 1) + " with 2 threads");
    EXPECT_TRUE(targets.insert(target).second) << target;
  }
  useSimdTargetOf({});
  EXPECT_TRUE(targets.contains(deviceNamed("cpu with 2 threads")->target()));
}

// Has memory, runs nothing, and remembers what it was asked for.
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

// Of some case, the outputs are not what they were before.
bool writesSomething(const Row& row, Device& device) {
  const OperationTests tests = row.tests();
  for (size_t i = 0; i < tests.cases.size(); ++i) {
    const uint64_t seed = seedOf(row.operation, i);
    IdleDevice idle;
    const Outputs before = outputsOf(tests.cases[i], idle, seed), after = outputsOf(tests.cases[i], device, seed);
    EXPECT_EQ(idle.asked, std::vector<OperationId>{row.operation}) << tests.cases[i].name;
    for (size_t k = 0; k < after.size(); ++k)
      if (!difference(after[k], before[k], true).empty()) return true;
  }
  return false;
}

TEST(Devices, RunEveryOperation) {
  for (const std::string& name : deviceNames()) {
    useSimdTargetOf(name);
    Device* const device = deviceNamed(name);
    if (device == nullptr) continue;
    for (const Row& row : kRows) EXPECT_TRUE(writesSomething(row, *device)) << name << ", " << nameOf(row.operation);
  }
  useSimdTargetOf({});
  EXPECT_NE(deviceNamed("reference"), nullptr);
  EXPECT_NE(deviceNamed("cpu with 1 thread"), nullptr);
}

TEST(DevicesDeathTest, NameAnOperationThatTheyLack) {
  for (const std::string& name : deviceNames()) {
    useSimdTargetOf(name);
    Device* const device = deviceNamed(name);
    if (device == nullptr) continue;
    EXPECT_DEATH(device->run(UnlistedOperation()), "has no operation UnlistedOperation") << name;
  }
  useSimdTargetOf({});
}

}  // namespace
}  // namespace tessera::device_test
