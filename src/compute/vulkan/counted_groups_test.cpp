#include "compute/vulkan/counted_groups.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <memory>
#include <span>
#include <vector>

#include "gpu/testing/test_context.h"
#include "shaders/double_values.h"

namespace tessera {
namespace {

constexpr uint32_t kPerGroup = 64;  // local_size_x of double_values.comp
constexpr uint32_t kCapacity = 2000;

class CountedGroupsTest : public testing::Test {
 protected:
  void SetUp() override {
    context_ = openForTest();
    SKIP_WITHOUT_VULKAN(context_);
    stream_ = std::make_unique<GpuStream>(context_);
    doubles_ = std::make_unique<GpuKernel>(context_, kDoubleValuesSpirv);
    values_ = GpuBuffer(context_, kCapacity * sizeof(uint32_t));
    counters_ = GpuBuffer(context_, 2 * sizeof(uint32_t));
    rows_ = {counters_.address() + sizeof(uint32_t), counters_.address(), kCapacity, 0};
  }
  void TearDown() override { EXPECT_EQ(GpuContext::validationMessages(), 0); }

  // Sets the counters to the rows [first, end).
  void setCounters(uint32_t first, uint32_t end) {
    const std::array words = {first, end};
    stream_->upload(counters_, 0, std::as_bytes(std::span(words)));
  }

  // Runs a kernel and returns the number of workgroups that ran.
  uint32_t run(const Groups& groups) {
    const std::vector<uint32_t> ones(kCapacity, 1);
    stream_->upload(values_, 0, std::as_bytes(std::span(ones)));
    struct {
      uint64_t values;
      uint32_t count, unused;
    } const arguments = {values_.address(), kCapacity, 0};
    stream_->run(*doubles_, std::as_bytes(std::span(&arguments, 1)), groups);
    std::vector<uint32_t> values(kCapacity);
    stream_->download(values_, 0, std::as_writable_bytes(std::span(values)));
    return (std::count(values.begin(), values.end(), 2u) + kPerGroup - 1) / kPerGroup;
  }

  std::shared_ptr<GpuContext> context_;
  std::unique_ptr<GpuStream> stream_;
  std::unique_ptr<GpuKernel> doubles_;
  GpuBuffer values_, counters_;
  arguments::CountArguments rows_ = {};
};

TEST_F(CountedGroupsTest, AreEnoughForTheRowsThatTheDeviceHasCounted) {
  CountedGroups counted(context_, {.minimum = 4});
  const auto groups = [&](uint32_t elements) { return counted.of(*stream_, rows_, true, elements, kPerGroup, 1); };
  setCounters(10, 10 + 3 * kPerGroup);
  EXPECT_EQ(run(groups(1)), 3u);
  EXPECT_EQ(run(groups(5)), 15u);
  setCounters(10, 10 + 3 * kPerGroup + 1);
  counted.changed(counters_.address() + sizeof(uint32_t), sizeof(uint32_t));
  EXPECT_EQ(run(groups(1)), 4u);
  setCounters(kPerGroup, 10 + 3 * kPerGroup + 1);
  counted.changed(counters_.address(), sizeof(uint32_t));
  EXPECT_EQ(run(groups(1)), 3u);
}

TEST_F(CountedGroupsTest, AreAtLeastOneAndWithinTheCapacity) {
  CountedGroups counted(context_, {.minimum = 1, .maximum = 8});
  const auto groups = [&] {
    counted.changed(counters_.address(), counters_.bytes());
    return counted.of(*stream_, rows_, true, 1, kPerGroup, 1);
  };
  setCounters(5, 5);
  EXPECT_EQ(run(groups()), 1u);
  setCounters(6, 5);
  EXPECT_EQ(run(groups()), 1u);
  rows_.capacity = 4 * kPerGroup;
  setCounters(0, kCapacity);
  EXPECT_EQ(run(groups()), 4u);
  rows_.capacity = kCapacity;
  EXPECT_EQ(run(groups()), 8u);
}

TEST_F(CountedGroupsTest, AreCountedOnceUntilCountersMayHaveChanged) {
  CountedGroups counted(context_, {.minimum = 1});
  setCounters(0, 3 * kPerGroup);
  const auto of = [&] { return counted.of(*stream_, rows_, true, 1, kPerGroup, 1); };
  EXPECT_EQ(run(of()), 3u);
  setCounters(0, 7 * kPerGroup);
  EXPECT_EQ(run(of()), 3u);
  counted.changed(counters_.address() - 4, 4);
  counted.changed(counters_.address() + counters_.bytes(), 4);
  EXPECT_EQ(run(of()), 3u);
  counted.changed(counters_.address(), counters_.bytes());
  EXPECT_EQ(run(of()), 7u);
}

TEST_F(CountedGroupsTest, AreNotCountedBelowTheMinimum) {
  constexpr uint32_t kEnough = (kCapacity + kPerGroup - 1) / kPerGroup;
  CountedGroups counted(context_, {.minimum = kEnough + 1});
  setCounters(0, 0);
  EXPECT_EQ(run(counted.of(*stream_, rows_, true, 1, kPerGroup, 1)), kEnough);
  CountedGroups always(context_, {.minimum = 1});
  EXPECT_EQ(run(always.of(*stream_, rows_, true, 1, kPerGroup, 1)), 1u);
  EXPECT_EQ(run(always.of(*stream_, rows_, false, 1, kPerGroup, 1)), kEnough) << "no counter";
}

TEST_F(CountedGroupsTest, HaveTheSameAddressAtEveryCapacity) {
  CountedGroups counted(context_, {.minimum = 1});
  setCounters(0, kCapacity);
  const auto groups = [&](uint32_t capacity, uint32_t elements = 1) {
    rows_.capacity = capacity;
    return counted.of(*stream_, rows_, true, elements, kPerGroup, 1);
  };
  const Groups many = groups(7 * kPerGroup);
  EXPECT_EQ(run(many), 7u);
  const Groups few = groups(2 * kPerGroup);
  EXPECT_EQ(few, many);
  EXPECT_EQ(run(few), 2u);
  EXPECT_EQ(run(groups(5 * kPerGroup)), 5u);
  EXPECT_NE(groups(5 * kPerGroup, 2), many);
}

TEST_F(CountedGroupsTest, AreCorrectWhenAllPlacesAreTaken) {
  CountedGroups counted(context_, {.minimum = 1});
  setCounters(0, 6 * kPerGroup);
  for (uint32_t elements = 1; elements < 5000; ++elements) counted.of(*stream_, rows_, true, elements, kPerGroup, 1);
  EXPECT_EQ(run(counted.of(*stream_, rows_, true, 1, kPerGroup, 1)), 6u);
  EXPECT_EQ(run(counted.of(*stream_, rows_, true, 2, kPerGroup, 1)), 12u);
}

}  // namespace
}  // namespace tessera
