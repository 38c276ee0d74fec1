#include "base/folder_size.h"

#include <gtest/gtest.h>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(FolderSize, CountsFilesButNotThoseBehindLinks) {
  const TemporaryFolder folder;
  EXPECT_EQ(bytesBelow(folder / "absent"), 0);
  writeFileAtomically(folder / "one/a/b", std::string(1200, 'a'));
  writeFileAtomically(folder / "one/c", std::string(300, 'a'));
  writeFileAtomically(folder / "two/d", std::string(50, 'a'));
  fs::create_symlink(folder / "one/c", folder / "one/link");
  fs::create_directory_symlink(folder / "two", folder / "one/folder");
  writeFileAtomically(folder / "elsewhere/e", std::string(80, 'a'));
  fs::create_hard_link(folder / "elsewhere/e", folder / "one/e");
  EXPECT_EQ(bytesBelow(folder / "one"), 1500);
  EXPECT_EQ(bytesBelow(folder.path()), 1550);
}

}  // namespace
}  // namespace tessera
