#include "pipeline/left_out_json.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/testing/temporary_folder.h"

namespace tessera {
namespace {

TEST(LeftOutJson, ReadsWhatItWrites) {
  const TemporaryFolder folder;
  writeLeftOut(folder / "left_out.json", {});
  EXPECT_TRUE(readLeftOut(folder / "left_out.json").empty());
  writeLeftOut(folder / "left_out.json", {{"a \"b\".jpg", "truncated"}, {"\xff.jpg", "not decodable"}});
  const std::vector<LeftOutPhoto> photos = readLeftOut(folder / "left_out.json");
  ASSERT_EQ(photos.size(), 2u);
  EXPECT_EQ(photos[0].name, "a \"b\".jpg");
  EXPECT_EQ(photos[0].reason, "truncated");
  EXPECT_EQ(photos[1].name, "\xef\xbf\xbd.jpg") << "U+FFFD";
}

TEST(LeftOutJson, NamesEachPhotoOnce) {
  const TemporaryFolder folder;
  const fs::path file = folder / "left_out.json";
  addLeftOut(file, {"a.jpg"}, "damaged");
  EXPECT_FALSE(fs::exists(file)) << "the stage that writes it says more";
  writeLeftOut(file, {{"b.jpg", "few features"}});
  for (int repetition = 0; repetition < 2; ++repetition) addLeftOut(file, {"a.jpg", "b.jpg"}, "damaged");
  const std::vector<LeftOutPhoto> photos = readLeftOut(file);
  ASSERT_EQ(photos.size(), 2u);
  EXPECT_EQ(photos[0].reason, "few features");
  EXPECT_EQ(photos[1].name + " " + photos[1].reason, "a.jpg damaged");
}

TEST(LeftOutJson, IsRefusedIfItIsDamaged) {
  const TemporaryFolder folder;
  const fs::path file = folder / "left_out.json";
  EXPECT_THROW(readLeftOut(file), Error);
  for (const char* text : {"", "{}", "[1]", "[{\"photo\": \"a\"}]", "[{\"reason\": \"a\"}]",
                           "[{\"photo\": 1, \"reason\": \"a\"}]", "[{\"photo\": \"a\", \"reason\": null}]"}) {
    writeFileAtomically(file, text);
    try {
      readLeftOut(file);
      ADD_FAILURE() << "was read: " << text;
    } catch (const Error& error) {
      EXPECT_EQ(error.subject(), file.string()) << text;
    }
  }
}

}  // namespace
}  // namespace tessera
