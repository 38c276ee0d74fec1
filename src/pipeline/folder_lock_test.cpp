#include "pipeline/folder_lock.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(FolderLock, HoldsOffOthersUntilItEnds) {
  const TemporaryFolder folder;
  const fs::path place = folder / "new/place";
  {
    const FolderLock lock(place);
    try {
      const FolderLock other(place);
      FAIL() << "two hold the folder";
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find(std::to_string(::getpid())), std::string::npos);
    }
  }
  EXPECT_NO_THROW(FolderLock{place});
}

TEST(FolderLock, LeavesTheFileOfAnotherProgramAsItIs) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "lock", "of a package manager");
  EXPECT_THROW(FolderLock{folder.path()}, Error);
  EXPECT_EQ(readTextFile(folder / "lock"), "of a package manager");
}

TEST(FolderLock, EndsWithAProcessThatIsKilled) {
  const TemporaryFolder folder;
  const pid_t other = ::fork();
  if (other == 0) {
    const FolderLock lock(folder.path());
    ::kill(::getpid(), SIGKILL);
  }
  ::waitpid(other, nullptr, 0);
  EXPECT_NO_THROW(FolderLock{folder.path()});
}

}  // namespace
}  // namespace tessera
