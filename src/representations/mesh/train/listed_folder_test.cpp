#include "representations/mesh/train/listed_folder.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

class ListedFolders : public ::testing::Test {
 protected:
  TemporaryFolder scene;
  ListedFolder folder{scene / "made", "things"};
};

TEST_F(ListedFolders, AreCompleteWhenTheirListIsWritten) {
  EXPECT_FALSE(folder.isComplete());
  folder.writeFile("a.bin", Bytes(3));
  EXPECT_FALSE(folder.isComplete());
  folder.writeList({{"a", "a.bin"}});
  EXPECT_TRUE(folder.isComplete());
  EXPECT_EQ(folder.readList(), nlohmann::json({{"a", "a.bin"}}));
  EXPECT_EQ(readFile(folder.file("a.bin")).size(), 3u);
  folder.remove();
  EXPECT_FALSE(folder.isComplete());
  EXPECT_FALSE(fs::exists(folder.path()));
}

TEST_F(ListedFolders, KeepWhatTheyDidNotWriteWhole) {
  folder.writeFile("a.bin", Bytes(3));
  folder.remove();  // not complete: the files may be somebody else's
  EXPECT_TRUE(fs::exists(folder.file("a.bin")));
}

TEST_F(ListedFolders, NameAListThatIsMalformed) {
  for (const char* text : {"", "[]", "{}", "{\"others\": []}", "{\"things\""}) {
    writeFileAtomically(scene / "made" / "things.json", std::string(text));
    try {
      folder.readList();
      FAIL() << text;
    } catch (const Error& error) {
      EXPECT_NE(std::string(error.what()).find("things.json"), std::string::npos) << error.what();
      EXPECT_NE(std::string(error.what()).find("remove the file"), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace tessera
