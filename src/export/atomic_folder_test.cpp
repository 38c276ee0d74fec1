#include "export/atomic_folder.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include "base/error.h"

namespace tessera {
namespace {

class AtomicFolderOnDisk : public testing::Test {
 protected:
  void SetUp() override {
    root_ = fs::temp_directory_path() / ("tessera-whole-" + std::to_string(::getpid()));
    fs::remove_all(root_);
    fs::create_directories(root_);
  }
  void TearDown() override { fs::remove_all(root_); }

  static bool isOurs(const std::string& name) { return name.starts_with("part"); }
  void write(const std::string& name, std::string_view text) const { writeFileAtomically(root_ / name, text); }
  size_t entries() const {
    return static_cast<size_t>(std::distance(fs::directory_iterator(root_), fs::directory_iterator()));
  }
  fs::path root_;
};

TEST_F(AtomicFolderOnDisk, AppearsWhenItIsWhole) {
  for (const char* place : {"new", "slash/", "deep/er", "empty"}) {
    if (place == std::string("empty")) fs::create_directories(root_ / place);
    AtomicFolder folder(root_ / place, isOurs);
    writeFileAtomically(folder.path() / "part1", std::string_view("1"));
    EXPECT_FALSE(fs::exists(root_ / place / "part1")) << place;
    folder.commit();
    EXPECT_EQ(readTextFile(root_ / place / "part1"), "1");
  }
  EXPECT_EQ(entries(), 4u);
}

TEST_F(AtomicFolderOnDisk, LeavesTheOldOneWhereItIsNotCommitted) {
  write("old/part1", "1");
  {
    AtomicFolder folder(root_ / "old", isOurs);
    writeFileAtomically(folder.path() / "part1", std::string_view("2"));
    EXPECT_EQ(entries(), 2u);
  }
  EXPECT_EQ(readTextFile(root_ / "old/part1"), "1");
  EXPECT_EQ(entries(), 1u);
}

TEST_F(AtomicFolderOnDisk, ReplacesWhatALinkLeadsTo) {
  write("large disk/old/part1", "1");
  fs::create_directory_symlink(root_ / "large disk/old", root_ / "link");
  AtomicFolder folder(root_ / "link", isOurs);
  writeFileAtomically(folder.path() / "part1", std::string_view("2"));
  folder.commit();
  EXPECT_TRUE(fs::is_symlink(root_ / "link"));
  EXPECT_EQ(readTextFile(root_ / "large disk/old/part1"), "2");
  EXPECT_EQ(entries(), 2u);
}

TEST_F(AtomicFolderOnDisk, TakesThePlaceOfAnOlderOne) {
  write("old/part1", "1");
  write("old/part2", "2");
  AtomicFolder folder(root_ / "old", isOurs);
  writeFileAtomically(folder.path() / "part1", std::string_view("3"));
  folder.commit();
  EXPECT_EQ(readTextFile(root_ / "old/part1"), "3");
  EXPECT_FALSE(fs::exists(root_ / "old/part2"));
  EXPECT_EQ(entries(), 1u);
}

TEST_F(AtomicFolderOnDisk, RemovesWhatKilledProcessesLeftBeside) {
  constexpr int kNobody = 1 << 30;  // above any process number
  write("new.partial-" + std::to_string(kNobody) + "/part1", "1");
  write("new.partial-" + std::to_string(::getppid()) + "/part1", "1");
  write("new.partial-mine/part1", "1");
  AtomicFolder(root_ / "new", isOurs).commit();
  EXPECT_EQ(entries(), 3u) << "the new one, one that is still written, and one that nobody knows";
}

TEST_F(AtomicFolderOnDisk, PutsBackWhatAKilledProcessWasReplacing) {
  const std::string nobody = ".partial-" + std::to_string(1 << 30);
  write("new" + nobody + "-old/part1", "1");
  write("new" + nobody + "-bytes", "1");
  write("new.old/part1", "a user's own");
  { AtomicFolder folder(root_ / "new", isOurs); }
  EXPECT_EQ(readTextFile(root_ / "new/part1"), "1");
  EXPECT_TRUE(fs::exists(root_ / "new.old/part1"));
  EXPECT_EQ(entries(), 2u);
  write("new" + nobody + "-old/part1", "2");
  { AtomicFolder folder(root_ / "new", isOurs); }
  EXPECT_EQ(readTextFile(root_ / "new/part1"), "1") << "nothing was lost";
  EXPECT_EQ(entries(), 2u);
}

TEST_F(AtomicFolderOnDisk, RefusesAPlaceThatHoldsSomethingElse) {
  write("file", "x");
  write("mixed/part1", "1");
  write("mixed/letter", "x");
  write("nested/part1/part2", "1");
  for (const char* place : {"file", "mixed", "nested"}) {
    EXPECT_THROW(AtomicFolder(root_ / place, isOurs), Error) << place;
  }
  EXPECT_EQ(entries(), 3u);
}

}  // namespace
}  // namespace tessera
