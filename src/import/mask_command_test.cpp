#include "import/mask_command.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "import/importer.h"
#include "import/testing/test_support.h"

namespace tessera {
namespace {

// A nerfstudio folder with two photos of 16 × 12 pixels, the second of which has a mask that is black at (5, 5), and
// a program that copies a prepared mask, black at (2, 3), and writes down the photos that it gets.
class MaskCommands : public testing::Test {
 protected:
  void SetUp() override {
    source_ = folder_ / "source";
    out_ = folder_ / "the capture";  // paths with spaces are one argument
    for (const char* name : {"a.png", "b.png"}) writePng(source_ / "images" / name, gradientPicture(16, 12));
    writePng(source_ / "masks/b.png", blackAt(5, 5));
    writePng(folder_ / "prepared.png", blackAt(2, 3));
    const std::string pose = R"("transform_matrix":[[1,0,0,0],[0,0,-1,0],[0,1,0,2],[0,0,0,1]])";
    writeFileAtomically(source_ / "transforms.json",
                        R"({"w":16,"h":12,"fl_x":20,"frames":[{"file_path":"images/a.png",)" + pose +
                            R"(},{"file_path":"images/b.png","mask_path":"masks/b.png",)" + pose + "}]}");
    program("cp \"$here/prepared.png\" \"$2\"");
  }
  static ImageU8 blackAt(int x, int y, int width = 16) {
    ImageU8 mask(width, 12, 1, 255);
    *mask.at(x, y) = 0;
    return mask;
  }
  // Writes the shell script that stands for a program; its arguments are $1 and $2.
  void program(const std::string& lines) {
    writeFileAtomically(folder_ / "segment.sh",
                        "here=" + folder_.path().string() + "\necho \"$1\" >> \"$here/calls\"\n" + lines + "\n");
  }
  std::string command(const std::string& more = "") const {
    return "sh '" + (folder_ / "segment.sh").string() + "'" + more;
  }
  Capture import(const std::string& maskCommand) { return importCapture(source_, out_, {.maskCommand = maskCommand}); }
  // Imports, and returns the error's text.
  std::string failure(const std::string& maskCommand) {
    try {
      import(maskCommand);
    } catch (const Error& error) {
      EXPECT_FALSE(fs::exists(out_ / "transforms.json"));
      for (const auto& entry : fs::recursive_directory_iterator(fs::exists(out_) ? out_ : source_))
        EXPECT_EQ(entry.path().string().find("partial"), std::string::npos) << entry.path();
      return error.what();
    }
    ADD_FAILURE() << "there was no error";
    return "";
  }
  std::string calls() const { return fs::exists(folder_ / "calls") ? readTextFile(folder_ / "calls") : ""; }

  TemporaryFolder folder_;
  fs::path source_, out_;
};

TEST_F(MaskCommands, MaskPhotosTogetherWithTheMasksOfTheSource) {
  const Capture capture = import(command());
  ASSERT_EQ(capture.photos.size(), 2u);
  for (int photo = 0; photo < 2; ++photo) {
    const ImageU8 mask = readImage(capture.photos[photo].mask).image;
    ASSERT_EQ(mask.channels, 1);
    for (int y = 0; y < 12; ++y)
      for (int x = 0; x < 16; ++x) {
        const bool black = (x == 2 && y == 3) || (photo == 1 && x == 5 && y == 5);
        EXPECT_EQ(*mask.at(x, y), black ? 0 : 255) << photo << ": " << x << ", " << y;
      }
  }
  const std::string photos = (out_ / "images/a.png").string() + "\n" + (out_ / "images/b.png").string() + "\n";
  EXPECT_EQ(calls(), photos) << "the photos as they are stored";
  import(command());
  EXPECT_EQ(calls(), photos) << "the masks are ready";
  fs::remove(out_ / "masks/b.png");
  import(command());
  EXPECT_EQ(calls(), photos + (out_ / "images/b.png").string() + "\n") << "an import that was interrupted";
  import(command(" {photo} {mask}"));
  EXPECT_EQ(calls().size(), 2 * photos.size() + (out_ / "images/b.png").string().size() + 1) << "another command";
  EXPECT_TRUE(import("").photos[0].mask.empty());
}

TEST_F(MaskCommands, ThatFailNamePhotoAndCommand) {
  const std::string missing = failure("no-such-program --fast");
  EXPECT_NE(missing.find("images/a.png"), std::string::npos) << missing;
  EXPECT_NE(missing.find("no-such-program --fast cannot be started: No such file"), std::string::npos) << missing;
  program("echo writing > \"$2\"; echo out of memory >&2; exit 4");
  EXPECT_NE(failure(command()).find("ended with status 4: out of memory"), std::string::npos);
  program("true");
  EXPECT_NE(failure(command()).find("wrote no mask"), std::string::npos);
  program("echo no picture > \"$2\"");
  EXPECT_NE(failure(command()).find("cannot be decoded"), std::string::npos);
  writePng(folder_ / "prepared.png", blackAt(2, 3, 8));
  program("cp \"$here/prepared.png\" \"$2\"");
  EXPECT_NE(failure(command()).find("wrote a mask of 8 x 12 pixels, and the photo has 16 x 12"), std::string::npos);
  writePng(folder_ / "prepared.png", blackAt(2, 3));
  EXPECT_EQ(import(command()).photos.size(), 2u) << "after the program was corrected";
}

// Then the program is corrected, which its command does not tell.
TEST_F(MaskCommands, AreRunAgainAfterTheirMasksExcludedEverything) {
  const ImageU8 prepared = readImage(folder_ / "prepared.png").image;
  writePng(folder_ / "prepared.png", ImageU8(16, 12, 1, 1));
  EXPECT_NE(failure(command()).find("excludes all pixels of all photos"), std::string::npos);
  writePng(folder_ / "prepared.png", prepared);
  EXPECT_EQ(readImage(import(command()).photos[0].mask).image.at(3, 3)[0], 255);
}

TEST_F(MaskCommands, ThatAreMalformedAreRefusedAtOnce) {
  EXPECT_NE(failure(" ").find("names no program"), std::string::npos);
  EXPECT_NE(failure(command(" {photo}")).find("only one of {photo} and {mask}"), std::string::npos);
  EXPECT_NE(failure("sh 'a").find("quotation mark"), std::string::npos);
  EXPECT_FALSE(fs::exists(out_));
}

TEST_F(MaskCommands, AreNotRunByAShell) {
  EXPECT_EQ(import(command(" {photo} {mask} ; touch '" + (folder_ / "touched").string() + "'")).photos.size(), 2u);
  EXPECT_FALSE(fs::exists(folder_ / "touched"));
}

}  // namespace
}  // namespace tessera
