#include "pipeline/set_aside.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(SetAside, KeepsAllEarlierResults) {
  const TemporaryFolder folder;
  setAside(folder / "poses");
  EXPECT_TRUE(fs::is_empty(folder.path()));
  for (const char* text : {"first", "second", "third"}) {
    writeFileAtomically(folder / "poses/a", std::string_view(text));
    setAside(folder / "poses");
    EXPECT_FALSE(fs::exists(folder / "poses"));
  }
  EXPECT_EQ(readTextFile(folder / "poses.earlier/a"), "first");
  EXPECT_EQ(readTextFile(folder / "poses.earlier-2/a"), "second");
  EXPECT_EQ(readTextFile(folder / "poses.earlier-3/a"), "third");
}

}  // namespace
}  // namespace tessera
