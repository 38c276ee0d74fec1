#include "base/file_digest.h"

#include <gtest/gtest.h>

#include <set>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(FileDigest, FollowsFromSizeBeginningAndEndAlone) {
  const TemporaryFolder folder;
  const auto digest = [&](const std::string& text) {
    writeFileAtomically(folder / "file", text);
    return fileDigest(folder / "file");
  };
  std::set<std::string> digests;
  for (const size_t size : {0, 1, 65535, 65536, 65537, 131071, 131072, 131073, 400000}) {
    std::string text(size, 'a');
    const std::string before = digest(text);
    EXPECT_TRUE(digests.insert(before).second) << size;
    fs::last_write_time(folder / "file", fs::file_time_type());
    EXPECT_EQ(fileDigest(folder / "file"), before) << "the time has no part in it";
    for (const size_t at : {size_t{0}, size / 3, size - 1}) {
      if (at >= size || (at >= 65536 && at + 65536 < size)) continue;
      text[at] = 'b';
      EXPECT_NE(digest(text), before) << size << " " << at;
      text[at] = 'a';
    }
  }
  EXPECT_EQ(fileDigest(folder / "absent"), "-");
  EXPECT_EQ(fileDigest(folder.path()), "-");
}

}  // namespace
}  // namespace tessera
