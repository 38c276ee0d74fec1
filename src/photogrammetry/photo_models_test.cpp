#include "photogrammetry/photo_models.h"

#include <cmath>
#include <cstring>
#include <numeric>

#include "import/colmap_model.h"
#include "photogrammetry/colmap_writer.h"
#include "photogrammetry/testing/fake_colmap.h"

namespace tessera {
namespace {

void ignore(int64_t) {}

std::vector<int> numbers(int begin, int end) {
  std::vector<int> photos(static_cast<size_t>(end - begin));
  std::iota(photos.begin(), photos.end(), begin);
  return photos;
}

// The models of one list of photos, made by a script in place of colmap.
class PhotoModelsTest : public testing::Test {
 protected:
  PhotoModelsTest() {
    fs::create_directories(folder_ / "poses");
    makeDatabase(database_);
  }
  PhotoModels models(const std::string& script, bool mapsRest = false) {
    return PhotoModels(folder_ / "poses", list_, {.program = writeColmap(folder_, script, mapsRest).string()});
  }
  std::string prepared(const std::string& name, const std::vector<int>& photos, const FakeLens& lens = {}) {
    writeModel(folder_ / name, photos, lens);
    return (folder_ / name).string();
  }
  Camera adjustedCamera() { return readColmapModel(folder_ / "poses/adjusted").cameras.at(1); }

  TemporaryFolder folder_;
  const fs::path database_ = folder_ / "poses/database.db";
  PhotoList list_ = numberedPhotos(50);
};

TEST(ModelFolders, AreKeptIfTheyCannotBeReplaced) {
  const TemporaryFolder folder;
  writeFileAtomically(folder / "joined/a", std::string_view("before"));
  EXPECT_THROW(replaceFolder(folder / "missing", folder / "joined"), Error);
  EXPECT_EQ(readTextFile(folder / "joined/a"), "before");
  writeFileAtomically(folder / "new/a", std::string_view("after"));
  replaceFolder(folder / "new", folder / "joined");
  EXPECT_EQ(readTextFile(folder / "joined/a"), "after");
  EXPECT_FALSE(fs::exists(folder / "joined.before"));
}

TEST_F(PhotoModelsTest, SayThatNoPhotosCouldBePlaced) {
  PhotoModels estimated = models("echo 'ERROR: failed to create sparse model'; exit 1");
  const std::string message = errorMessage([&] { estimated.map(false, ignore); });
  EXPECT_NE(message.find("no two photos could be placed"), std::string::npos) << message;
  EXPECT_FALSE(fs::exists(folder_ / "poses/sparse"));
}

// A program may fail after its work, when it ends.
TEST_F(PhotoModelsTest, CountThoughTheProgramReportsFailureAfterwards) {
  PhotoModels estimated = models("case $command in mapper) cp -r " + prepared("a", numbers(0, 20)) +
                                 " $output_path/0; echo 'Elapsed time: 1 [minutes]';; bundle_adjuster) cp "
                                 "$input_path/* $output_path;; esac; exit 139");
  estimated.map(false, ignore);
  EXPECT_EQ(estimated.unplaced(), numbers(20, 50));
  estimated.adjust(ignore);
  EXPECT_EQ(estimated.unplaced(), numbers(20, 50));
}

// It writes each model when that is finished: others may have been lost.
TEST_F(PhotoModelsTest, AreNotThoseOfAMapperThatFailedBeforeItsEnd) {
  PhotoModels estimated =
      models("cp -r " + prepared("a", numbers(0, 20)) + " $output_path/0; echo 'Registering image #30 (2)'; exit 139");
  EXPECT_THROW(estimated.map(false, ignore), Error);
  EXPECT_FALSE(fs::exists(folder_ / "poses/sparse"));
}

TEST_F(PhotoModelsTest, AreRefusedIfTheyWereNotWrittenToTheirEnd) {
  const std::string whole = prepared("a", numbers(0, 20));
  PhotoModels estimated =
      models("cp -r " + whole + " $output_path/0; head -c 99 " + whole + "/points3D.bin > $output_path/0/points3D.bin");
  const std::string message = errorMessage([&] { estimated.map(false, ignore); });
  EXPECT_NE(message.find("sparse.partial/0: was not written to its end"), std::string::npos) << message;
}

TEST_F(PhotoModelsTest, MayHaveNoPointsAtAll) {
  writeModel(folder_ / "none", numbers(0, 5), {}, 0);
  PhotoModels estimated = models("cp -r " + (folder_ / "none").string() + " $output_path/0");
  const std::string message = errorMessage([&] { estimated.map(false, ignore); });
  EXPECT_NE(message.find("no two photos could be placed"), std::string::npos) << message;
}

TEST_F(PhotoModelsTest, StayAsTheyWereIfTheirAdjustmentFails) {
  PhotoModels estimated = models("case $command in mapper) cp -r " + prepared("a", numbers(0, 12)) +
                                 " $output_path/0;; bundle_adjuster) exit 1;; esac");
  estimated.map(false, ignore);
  estimated.adjust(ignore);
  EXPECT_EQ(adjustedCamera().parameters[0], 640);
  EXPECT_EQ(estimated.read().capture.photos.size(), 12u);
}

TEST_F(PhotoModelsTest, AreRefusedIfTheySeeHardlyAnyPoint) {
  writeModel(folder_ / "turned", numbers(0, 5), {}, 40);
  PhotoModels estimated = models("cp -r " + (folder_ / "turned").string() + " $output_path/0");
  const std::string message = errorMessage([&] { estimated.map(false, ignore); });
  EXPECT_NE(message.find("taken from different places"), std::string::npos) << message;
}

TEST_F(PhotoModelsTest, HaveTheMasksOfTheirPhotos) {
  list_.photos[1].mask = "/masks/p1.png";
  PhotoModels estimated = models("cp -r " + prepared("a", numbers(0, 3)) + " $output_path/0");
  estimated.map(false, ignore);
  for (const Photo& photo : estimated.read().capture.photos)
    EXPECT_EQ(photo.mask, photo.name == "p1.jpg" ? "/masks/p1.png" : "") << photo.name;
}

// The mapper makes no second model unless it is asked for one of the other photos.
TEST_F(PhotoModelsTest, IncludeThoseOfPhotosThatTheFirstLacks) {
  PhotoModels estimated =
      models("if [ -n \"$image_list_path\" ]; then head -1 $image_list_path > " + (folder_ / "first").string() +
                 "; cp -r " + prepared("b", numbers(20, 50)) + " $output_path/0; else cp -r " +
                 prepared("a", numbers(0, 20)) + " $output_path/0; fi",
             true);
  estimated.map(false, ignore);
  EXPECT_EQ(readTextFile(folder_ / "first"), "p20.jpg\n");
  EXPECT_EQ(estimated.countMapped().models, 2u);
  EXPECT_EQ(estimated.unplaced(), numbers(0, 20)) << "the larger one counts";
  EXPECT_EQ(estimated.placedApart(), numbers(0, 20));
}

// Photos 20 to 49 are mapped apart from the first ones, of which 16 to 19 are matched with them.
TEST_F(PhotoModelsTest, AreContinuedWithThePhotosThatMatchesLinkWithThem) {
  for (int i = 16; i < 20; ++i) addInliers(database_, i, 20, 60);
  addInliers(database_, 2, 30, 37);  // as of photos that do not overlap
  const std::string lists = (folder_ / "lists").string();
  PhotoModels estimated =
      models("if [ -z \"$image_list_path\" ]; then cp -r " + prepared("a", numbers(0, 20)) +
                 " $output_path/0; exit; fi; echo $(head -1 $image_list_path) ${input_path##*/} >> " + lists +
                 "; if [ -n \"$input_path\" ]; then cp " + prepared("c", numbers(16, 50)) +
                 "/* $output_path; else cp -r " + prepared("b", numbers(20, 50)) + " $output_path/0; fi",
             true);
  estimated.map(false, ignore);
  EXPECT_EQ(readTextFile(folder_ / "lists"), "p20.jpg\np16.jpg 1\n");
  EXPECT_EQ(estimated.countMapped().models, 2u);
  EXPECT_EQ(estimated.unplaced(), numbers(0, 16)) << "until they are joined";
}

// A first model without photos that are well matched with it has begun badly.
TEST_F(PhotoModelsTest, AreMappedAgainFromOtherPairsIfManyLinkedPhotosAreMissing) {
  list_ = numberedPhotos(12);
  for (int i = 0; i < 10; ++i)
    for (const int missing : {10, 11}) addInliers(database_, i, missing, 100 + 10 * i + missing);
  const std::string pairs = (folder_ / "pairs").string();
  PhotoModels estimated =
      models("if [ -z \"$image_list_path\" ]; then cp -r " + prepared("a", numbers(0, 10)) +
                 " $output_path/0; exit; fi; echo $Mapper_init_image_id1 $Mapper_init_image_id2 >> " + pairs +
                 "; [ $Mapper_init_image_id2 = 11 ] && cp -r " + prepared("b", numbers(0, 12)) + " $output_path/0",
             true);
  estimated.map(false, ignore);
  EXPECT_EQ(readTextFile(folder_ / "pairs"), "10 12\n10 11\n") << "those with the most inliers";
  EXPECT_EQ(estimated.unplaced(), std::vector<int>());
}

TEST_F(PhotoModelsTest, GoOnFromTheLastSnapshotThatIsWhole) {
  const std::string model = prepared("whole", numbers(0, 18)), fewer = prepared("fewer", numbers(0, 9));
  // Photos 17 and 18 are matched: the former is mapped again with those that the model lacks, to be joined with it.
  addInliers(database_, 17, 18, 60);
  // The first run writes snapshots and fails; with a model to go on from, it returns that model.
  const std::string listed = (folder_ / "listed").string();
  PhotoModels estimated =
      models("if [ -n \"$image_list_path\" ]; then cp $image_list_path " + listed +
                 "; echo failed to create sparse model; exit 1; fi\nif [ -n \"$input_path\" ]; then cp $input_path/* "
                 "$output_path; exit; fi\ncp -r " +
                 model + " $Mapper_snapshot_path/18446744073709551615; cp -r " + fewer +
                 " $Mapper_snapshot_path/8; mkdir $Mapper_snapshot_path/7; cp " + model +
                 "/images.bin $Mapper_snapshot_path/7; : > $Mapper_snapshot_path/7/points3D.bin; exit 1",
             true);
  EXPECT_THROW(estimated.map(false, ignore), Error);
  EXPECT_TRUE(fs::exists(folder_ / "poses/snapshots/7"));
  estimated.map(true, ignore);
  EXPECT_EQ(readTextFile(listed).substr(0, 16), "p17.jpg\np18.jpg\n");
  EXPECT_EQ(estimated.unplaced(), numbers(18, 50));
  EXPECT_EQ(estimated.read().capture.photos.size(), 18u);
  EXPECT_FALSE(fs::exists(folder_ / "poses/snapshots"));
  EXPECT_THROW(estimated.map(false, ignore), Error) << "a new beginning has no snapshot to go on from";
  EXPECT_EQ(estimated.read().capture.photos.size(), 18u) << "models remain until others replace them";
}

// A folder of two places: the mapper is at the second one when it is killed.
TEST_F(PhotoModelsTest, GoOnFromASnapshotBesideModelsThatAreFinished) {
  const std::string runs = (folder_ / "runs").string();
  const std::string first = "if [ -n \"$image_list_path\" ]; then echo rest >> " + runs +
                            "; echo failed to create sparse model; exit 1; fi\n"
                            "if [ -n \"$input_path\" ]; then echo onward >> " +
                            runs + "; cp " + prepared("b", numbers(25, 45)) +
                            "/* $output_path; exit; fi\n"
                            "echo first >> " +
                            runs + "; cp -r " + prepared("small", numbers(0, 12)) + " $Mapper_snapshot_path/1; cp -r " +
                            prepared("a", numbers(0, 20)) + " $output_path/0\n";
  const std::string kill = "kill -9 $$";
  PhotoModels estimated =
      models(first + "cp -r " + prepared("begun", numbers(25, 30)) + " $Mapper_snapshot_path/2\n" + kill, true);
  EXPECT_THROW(estimated.map(false, ignore), ColmapKilled);
  estimated.map(true, ignore);
  EXPECT_EQ(readTextFile(runs), "first\nonward\nrest\n");
  EXPECT_EQ(estimated.countMapped().models, 2u);
  EXPECT_EQ(estimated.countMapped().photos, 40u);
  EXPECT_FALSE(fs::exists(folder_ / "poses/sparse.finished"));

  // Before the second one has a snapshot, those of the first are of no use: what is left is mapped on its own.
  fs::remove(runs);
  PhotoModels early = models(first + kill, true);
  EXPECT_THROW(early.map(false, ignore), ColmapKilled);
  early.map(true, ignore);
  EXPECT_EQ(readTextFile(runs), "first\nrest\nrest\n") << "with snapshots, and for those that are left then";
  EXPECT_EQ(readTextFile(folder_ / "poses/mapped.txt").substr(0, 8), "p20.jpg\n");
  EXPECT_EQ(early.countMapped().photos, 20u);
}

TEST_F(PhotoModelsTest, KeepNoSnapshotsOfModelsThatAreFinished) {
  PhotoModels estimated = models(
      "cp -r " + prepared("a", numbers(0, 20)) + " $Mapper_snapshot_path/1; cp -r " + prepared("b", numbers(0, 30)) +
      " $output_path/0; for i in $(seq 100); do [ -e $Mapper_snapshot_path/1 ] || break; sleep 0.2; done; cp -r " +
      prepared("c", numbers(40, 45)) + " $Mapper_snapshot_path/2; sleep 1; exit 1");
  EXPECT_THROW(estimated.map(false, ignore), Error);
  EXPECT_FALSE(fs::exists(folder_ / "poses/snapshots/1"));
  EXPECT_TRUE(fs::exists(folder_ / "poses/snapshots/2"));
}

// An interruption while further models are made costs only these.
TEST_F(PhotoModelsTest, AreNotMappedAgainIfOnlyFurtherOnesWereInterrupted) {
  const std::string runs = (folder_ / "runs").string();
  PhotoModels estimated = models("if [ -n \"$image_list_path\" ]; then sleep 60; fi; echo first >> " + runs +
                                     "; cp -r " + prepared("a", numbers(0, 20)) + " $output_path/0",
                                 true);
  const auto interrupt = [](int64_t photos) {
    if (photos >= 20) throw std::runtime_error("interrupted");
  };
  EXPECT_THROW(estimated.map(false, interrupt), std::runtime_error);
  EXPECT_THROW(estimated.map(true, interrupt), std::runtime_error);
  EXPECT_EQ(readTextFile(folder_ / "runs"), "first\n");
  EXPECT_THROW(estimated.map(false, interrupt), std::runtime_error);
  EXPECT_EQ(readTextFile(folder_ / "runs"), "first\nfirst\n") << "a new beginning";
}

TEST_F(PhotoModelsTest, KeepOnlyTheLargestSnapshotsWhileTheMapperRuns) {
  std::string script;
  for (int photos = 10; photos <= 40; photos += 10) {
    script += "cp -r " + prepared("m" + std::to_string(photos), numbers(0, photos)) + " $Mapper_snapshot_path/x" +
              std::to_string(photos) + "\n";
  }
  PhotoModels estimated = models(script + "sleep 2; exit 1");
  EXPECT_THROW(estimated.map(false, ignore), Error);
  EXPECT_FALSE(fs::exists(folder_ / "poses/snapshots/x10"));
  EXPECT_FALSE(fs::exists(folder_ / "poses/snapshots/x20"));
  EXPECT_TRUE(fs::exists(folder_ / "poses/snapshots/x30"));
  EXPECT_TRUE(fs::exists(folder_ / "poses/snapshots/x40"));
}

TEST_F(PhotoModelsTest, AreExtendedUnlessPhotosWouldBeLost) {
  const std::string first = prepared("first", numbers(0, 18)), more = prepared("more", numbers(0, 25)),
                    less = prepared("less", numbers(0, 10));
  const auto mapper = [&](const std::string& result) {
    return models("if [ -n \"$input_path\" ]; then cp " + result + "/* $output_path; else mkdir $output_path/0; cp " +
                  first + "/* $output_path/0; fi");
  };
  PhotoModels lost = mapper(less);
  lost.map(false, ignore);
  lost.extend(false, ignore);
  EXPECT_EQ(lost.unplaced(), numbers(18, 50));
  PhotoModels extended = mapper(more);
  extended.extend(false, ignore);
  EXPECT_EQ(extended.unplaced(), numbers(25, 50));
  EXPECT_FALSE(fs::exists(folder_ / "poses/extended.partial"));
}

// A program that maps three models, of which the merger can join the second with the first.
std::string joiningScript(const std::string& a, const std::string& b, const std::string& c, const std::string& both) {
  return "case $command in mapper) cp -r " + a + " $output_path/0; cp -r " + b + " $output_path/1; cp -r " + c +
         " $output_path/2;;\n"
         "model_merger) case $input_path2 in */1) cp " +
         both +
         "/* $output_path;; *) cp $input_path1/* $output_path;; esac;;\n"
         "point_triangulator|bundle_adjuster) cp $input_path/* $output_path;; esac";
}

TEST_F(PhotoModelsTest, AreJoinedWhereTheySharePhotos) {
  PhotoModels estimated = models(joiningScript(prepared("a", numbers(0, 20)), prepared("b", numbers(17, 30)),
                                               prepared("c", numbers(18, 24)), prepared("both", numbers(0, 30))));
  estimated.map(false, ignore);
  EXPECT_EQ(estimated.countMapped().models, 3u);
  EXPECT_EQ(estimated.countMapped().photos, 30u);
  EXPECT_EQ(estimated.unplaced(), numbers(20, 50));
  EXPECT_EQ(estimated.placedApart(), numbers(20, 30));
  // The merger writes the first model if it fails, as for the third here.
  EXPECT_EQ(estimated.join(ignore), 1);
  EXPECT_EQ(estimated.unplaced(), numbers(30, 50));
  estimated.map(false, ignore);
  EXPECT_EQ(estimated.unplaced(), numbers(20, 50)) << "new models replace what came of those before";
}

TEST_F(PhotoModelsTest, AreNotJoinedIfTheyShareTooFewPhotos) {
  PhotoModels estimated = models(joiningScript(prepared("a", numbers(0, 20)), prepared("b", numbers(18, 30)),
                                               prepared("c", numbers(40, 45)), prepared("both", numbers(0, 30))));
  estimated.map(false, ignore);
  EXPECT_EQ(estimated.join(ignore), 0);
  EXPECT_EQ(estimated.unplaced(), numbers(20, 50));
}

TEST_F(PhotoModelsTest, AreNotJoinedAgainstGps) {
  // Photos of `a` stand on a strip of 14 m × 211 m, as their fixes say; those of the joined model do not.
  for (int i = 0; i < 30; ++i) {
    GpsFix gps;
    gps.latitude = 50 + 1e-4 * i;
    gps.longitude = 8 + 1e-4 * (i % 3);
    list_.photos[static_cast<size_t>(i)].tags.gps = gps;
  }
  const auto write = [&](const std::string& name, int begin, int end, double bend) {
    const std::string path = prepared(name, numbers(begin, end));
    Bytes images = readFile(folder_ / name / "images.bin");
    size_t at = 8;
    for (int i = begin; i < end; ++i) {
      // The camera-from-world translation of a camera without rotation is the negative of its place.
      const double place[] = {-7.15 * (i % 3), -11.1 * i - bend * std::max(0, i - 20), 0};
      std::memcpy(images.data() + at + 36, place, sizeof place);
      at += 36 + 24 + 4 + 1 + std::string("p.jpg").size() + std::to_string(i).size() + 8;
    }
    writeFileAtomically(folder_ / name / "images.bin", images);
    return path;
  };
  const std::string a = write("a", 0, 20, 0), b = write("b", 17, 30, 0), c = prepared("c", numbers(40, 45));
  PhotoModels bent = models(joiningScript(a, b, c, write("bent", 0, 30, 40)));
  bent.map(false, ignore);
  EXPECT_EQ(bent.join(ignore), 0);
  PhotoModels straight = models(joiningScript(a, b, c, write("straight", 0, 30, 0)));
  straight.map(false, ignore);
  EXPECT_EQ(straight.join(ignore), 1);
}

// A program whose bundle adjustment sets these parameters of a lens with eight; it keeps others.
std::string adjustingScript(const std::string& model, const std::string& adjusted) {
  return "case $command in mapper) cp -r " + model +
         " $output_path/0;;\n"
         "bundle_adjuster) echo $BundleAdjustment_refine_principal_point >> " +
         model +
         "/../options; cp $input_path/* $output_path; if [ $(stat -c %s $input_path/cameras.bin) -gt 72 ]; then cp " +
         adjusted + "/cameras.bin $output_path; fi;; esac";
}

TEST_F(PhotoModelsTest, AreAdjustedWithAFullLensIfThereAreManyPhotos) {
  const FakeLens adjusted{4, {627, 628, 403, 298, -0.02, 0.006, 3e-4, -2e-4}};
  PhotoModels estimated = models(adjustingScript(prepared("a", numbers(0, 45)), prepared("adjusted", {0}, adjusted)));
  estimated.map(false, ignore);
  estimated.adjust(ignore);
  EXPECT_EQ(readTextFile(folder_ / "options"), "1\n");
  EXPECT_EQ(adjustedCamera().lens, LensModel::openCv);
  EXPECT_EQ(adjustedCamera().centreX(), 403);
  EXPECT_EQ(estimated.read().capture.photos.size(), 45u);
}

TEST_F(PhotoModelsTest, KeepASimpleLensIfThereAreFewPhotos) {
  PhotoModels estimated = models(adjustingScript(prepared("a", numbers(0, 12)), "none"));
  estimated.map(false, ignore);
  estimated.adjust(ignore);
  EXPECT_EQ(readTextFile(folder_ / "options"), "0\n");
  EXPECT_EQ(adjustedCamera().lens, LensModel::radial);
  EXPECT_EQ(adjustedCamera().parameters[0], 640);
}

TEST_F(PhotoModelsTest, AreAdjustedWithASimpleLensIfAFullOneIsNotPlausible) {
  const FakeLens adjusted{4, {627, 628, 700, 298, 0, 0, 0, 0}};
  PhotoModels estimated = models(adjustingScript(prepared("a", numbers(0, 45)), prepared("adjusted", {0}, adjusted)));
  estimated.map(false, ignore);
  estimated.adjust(ignore);
  EXPECT_EQ(readTextFile(folder_ / "options"), "1\n0\n");
  EXPECT_EQ(adjustedCamera().lens, LensModel::radial);
}

// A model whose photos show points below them, the third one with a wrong match in ten.
ColmapModel withWrongMatches(const fs::path& folder) {
  ColmapModel model = readColmapModel(folder);
  for (ColmapModel::Image& image : model.images) {
    image.keypoints.clear();
    for (const ColmapModel::Point& point : model.points) {
      const Vec3d x = point.point.xInWorld + Vec3d(image.translation[0], 0, 0);
      const double wrong =
          image.id == 3 && point.id % 10 == 0 ? 3 : 0.1 * static_cast<double>((point.id + image.id) % 3);
      image.keypoints.push_back({400 + 640 * x.x() / x.z() + wrong, 300, point.id});
    }
  }
  return model;
}

TEST_F(PhotoModelsTest, AreAdjustedAgainWithoutObservationsThatDisagree) {
  const std::string first = prepared("a", numbers(0, 12));
  writeColmapModel(withWrongMatches(first), first);
  PhotoModels estimated = models(adjustingScript(first, "none"));
  estimated.map(false, ignore);
  estimated.adjust(ignore);
  // The second time, nothing disagrees any more.
  EXPECT_EQ(readTextFile(folder_ / "options"), "0\n0\n");
  for (const ColmapModel::Image& image : readColmapModel(folder_ / "poses/adjusted").images)
    EXPECT_EQ(image.keypoints.size(), image.id == 3 ? 900u : 1000u) << image.id;
}

// Killed in the second adjustment.
TEST_F(PhotoModelsTest, AreAdjustedOnAfterAnInterruption) {
  const std::string first = prepared("a", numbers(0, 12)), runs = (folder_ / "runs").string();
  writeColmapModel(withWrongMatches(first), first);
  const auto countRuns = [&] {
    const std::string text = readTextFile(folder_ / "runs");
    return std::count(text.begin(), text.end(), '\n');
  };
  PhotoModels estimated =
      models("case $command in mapper) cp -r " + first + " $output_path/0;;\nbundle_adjuster) echo $input_path >> " +
             runs + "; [ $(wc -l < " + runs + ") = 2 ] && kill -9 $$; cp $input_path/* $output_path;; esac");
  for (const bool isNew : {false, true}) {
    SCOPED_TRACE(isNew ? "a new beginning" : "the first adjustment is not repeated");
    fs::remove(folder_ / "runs");
    estimated.map(false, ignore);
    EXPECT_THROW(estimated.adjust(ignore), ColmapKilled);
    EXPECT_FALSE(fs::exists(folder_ / "poses/adjusted"));
    if (isNew) estimated.discardAdjusted();
    estimated.adjust(ignore);
    EXPECT_EQ(countRuns(), isNew ? 4 : 3);
    for (const ColmapModel::Image& image : readColmapModel(folder_ / "poses/adjusted").images)
      EXPECT_EQ(image.keypoints.size(), image.id == 3 ? 900u : 1000u) << image.id;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_ / "poses"))
      EXPECT_FALSE(entry.path().filename().string().starts_with("adjusted.")) << entry.path();
    estimated.adjust(ignore);
    EXPECT_EQ(countRuns(), isNew ? 4 : 3) << "nothing is left to do";
  }
}

// Killed after a full lens was refused.
TEST_F(PhotoModelsTest, AreNotAdjustedAgainWithALensThatWasRefused) {
  const FakeLens adjusted{4, {627, 628, 700, 298, 0, 0, 0, 0}};
  const std::string model = prepared("a", numbers(0, 45)), killed = (folder_ / "killed").string();
  PhotoModels estimated =
      models("if [ \"$BundleAdjustment_refine_principal_point\" = 0 ] && [ ! -e " + killed + " ]; then touch " +
             killed + "; kill -9 $$; fi\n" + adjustingScript(model, prepared("adjusted", {0}, adjusted)));
  estimated.map(false, ignore);
  EXPECT_THROW(estimated.adjust(ignore), ColmapKilled);
  estimated.adjust(ignore);
  EXPECT_EQ(readTextFile(folder_ / "options"), "1\n0\n");
  EXPECT_EQ(adjustedCamera().lens, LensModel::radial);
}

TEST_F(PhotoModelsTest, StayAsTheyWereIfWithoutTheseTheyAreNotPlausible) {
  const std::string first = prepared("a", numbers(0, 12)), fewer = prepared("fewer", numbers(0, 11));
  writeColmapModel(withWrongMatches(first), first);
  const std::string again = (folder_ / "again").string();
  PhotoModels estimated = models("case $command in mapper) cp -r " + first +
                                 " $output_path/0;;\nbundle_adjuster) if [ -e " + again + " ]; then cp " + fewer +
                                 "/* $output_path; else cp $input_path/* $output_path; fi; touch " + again + ";; esac");
  estimated.map(false, ignore);
  estimated.adjust(ignore);
  EXPECT_TRUE(fs::exists(again));
  EXPECT_EQ(estimated.read().capture.photos.size(), 12u);
  for (const ColmapModel::Image& image : readColmapModel(folder_ / "poses/adjusted").images)
    EXPECT_EQ(image.keypoints.size(), 1000u) << image.id;
  EXPECT_FALSE(fs::exists(folder_ / "poses/adjusted.partial"));
}

}  // namespace
}  // namespace tessera
