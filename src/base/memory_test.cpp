#include "base/memory.h"

#include <gtest/gtest.h>
#include <sys/mman.h>

#include <cstring>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

constexpr size_t kMany = size_t{256} << 20;

// Uses memory for a moment, past all allocators.
void useMany() {
  void* memory = ::mmap(nullptr, kMany, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
  ASSERT_NE(memory, MAP_FAILED);
  std::memset(memory, 1, kMany);
  ::munmap(memory, kMany);
}

TEST(Memory, IsPartlyTakenByOtherPrograms) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "meminfo",
                      std::string_view("MemTotal:       24628412 kB\nMemFree:  2 kB\nMemAvailable:   1300 kB\n"));
  EXPECT_EQ(availableMemoryBytes(folder / "meminfo"), 1300 * 1024);
  EXPECT_EQ(availableMemoryBytes(folder / "absent"), usableMemoryBytes());
  writeFileAtomically(folder / "meminfo", std::string_view("MemAvailable: 9000000000000 kB\n"));
  EXPECT_EQ(availableMemoryBytes(folder / "meminfo"), usableMemoryBytes());
}

TEST(Memory, HasAPeakThatCanBeStartedAgain) {
  const int64_t before = residentBytes();
  ASSERT_GT(before, 0);
  useMany();
  EXPECT_GE(peakResidentBytes(), before + static_cast<int64_t>(kMany / 2));
  if (!restartPeakResidentBytes()) GTEST_SKIP() << "this kernel does not let processes start it again";
  EXPECT_LT(peakResidentBytes(), before + static_cast<int64_t>(kMany / 2));
  useMany();
  EXPECT_GE(peakResidentBytes(), before + static_cast<int64_t>(kMany / 2));
}

class ControlGroups : public testing::Test {
 protected:
  void limit(const char* file, const char* text) { writeFileAtomically(folder_ / "groups" / file, std::string(text)); }
  int64_t of(const char* membership) {
    writeFileAtomically(folder_ / "cgroup", std::string(membership));
    return controlGroupLimit(folder_ / "groups", folder_ / "cgroup");
  }

  TemporaryFolder folder_;
};

TEST_F(ControlGroups, LimitWhatTheGroupsAroundThemLimit) {
  EXPECT_EQ(of("0::/\n"), 0);
  limit("memory.max", "max\n");
  EXPECT_EQ(of("0::/\n"), 0);
  limit("slurm/memory.max", "9000\n");
  limit("slurm/job/memory.max", "max\n");
  limit("slurm/job/step/memory.max", "20000\n");
  EXPECT_EQ(of("0::/slurm/job/step\n"), 9000);
  EXPECT_EQ(of("0::/\n"), 0) << "the limit of another group";
  EXPECT_EQ(of("0::/elsewhere/inside\n"), 0) << "a path outside of the container";
  limit("memory.max", "5000\n");
  EXPECT_EQ(of("0::/slurm/job/step\n"), 5000);
  EXPECT_EQ(of("0::/elsewhere/inside\n"), 5000);
}

TEST_F(ControlGroups, LimitInTheFormerVersion) {
  limit("memory/docker/memory.limit_in_bytes", "7000\n");
  limit("memory/memory.limit_in_bytes", "9223372036854771712\n");
  EXPECT_EQ(of("11:cpu,cpuacct:/other\n8:memory:/docker\n"), 7000);
  EXPECT_EQ(of("8:hugetlb,memory:/docker\n"), 7000);
  EXPECT_EQ(of("nonsense\n:\n"), 0);
  EXPECT_EQ(controlGroupLimit(folder_ / "groups", folder_ / "none"), 0);
}

}  // namespace
}  // namespace tessera
