#include "photogrammetry/photo_models.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "base/error.h"
#include "base/log.h"
#include "import/colmap_model.h"
#include "import/georeference.h"

namespace tessera {

PhotoModels::PhotoModels(fs::path folder, const PhotoList& list, ColmapSettings settings)
    : folder_(std::move(folder)), list_(list), settings_(std::move(settings)) {}

void PhotoModels::runColmap(const char* step, std::vector<std::string> arguments, const std::function<void()>& look,
                            const std::function<bool()>& isDone) {
  ColmapProgram colmap(folder_ / fmt::format("{}.log", step), settings_.program);
  colmap.run(std::move(arguments), look, isDone);
}

void PhotoModels::adjustBundle(const char* step, const fs::path& input, const fs::path& output,
                               bool movesPrincipalPoint, const std::function<void()>& look) {
  // Surveys have needed five to eight iterations until the cost changes by less than this share of it.
  constexpr const char *kMaxIterations = "50", *kTolerance = "1e-6";
  runColmap(step,
            {"bundle_adjuster", "--input_path", input.string(), "--output_path", output.string(),
             "--BundleAdjustment.max_num_iterations", kMaxIterations, "--BundleAdjustment.function_tolerance",
             kTolerance, "--BundleAdjustment.refine_principal_point", movesPrincipalPoint ? "1" : "0"},
            look, [&] { return !photosIn(output).empty(); });
}

void PhotoModels::discardMapped() const {
  for (const char* name : {"snapshots", "snapshot.begun", "sparse.partial", "sparse.continued", "sparse.whole",
                           "sparse.finished", "rest.partial"})
    removeFolder(folder_ / name);
}

void PhotoModels::discardJoined() const {
  discardAdjusted();
  for (const char* name : {"joined", "joined.before", "joined.partial", "joined.attempt", "joined.points",
                           "joined.adjusted", "extended.partial", "snapshots", "snapshot.begun"})
    removeFolder(folder_ / name);
}

fs::path PhotoModels::last(bool adjusted) const {
  std::error_code status;
  if (adjusted && fs::exists(folder_ / "adjusted", status)) return folder_ / "adjusted";
  if (fs::exists(folder_ / "joined", status)) return folder_ / "joined";
  const std::vector<Piece> pieces = piecesIn(folder_ / "sparse");
  if (pieces.empty()) throw Error((folder_ / "sparse").string(), "", "holds no model", "run the stage `mapping` again");
  return pieces[0].folder;
}

bool PhotoModels::agreesWithGps(const fs::path& joined, const fs::path& before) const {
  const auto fit = [&](const fs::path& model) {
    const SourceCapture source = readFrom(model);
    std::string reason;
    return georeference(source.capture.photos, source.flight, reason);
  };
  constexpr double kWorse = 1.5, kMetres = 1, kFewer = 0.9;
  const auto was = fit(before);
  if (!was) return true;  // nothing can be said
  const auto is = fit(joined);
  if (!is) return false;
  const auto share = [](const Georeference& fit) { return static_cast<double>(fit.inliers) / fit.fixes; };
  const double maxMetres = kWorse * was->rmsMetres + kMetres;
  return is->rmsMetres < maxMetres && share(*is) > kFewer * share(*was);
}

int PhotoModels::join(const Watch& watch) {
  for (const char* name : {"sparse.continued", "sparse.whole"}) removeFolder(folder_ / name);  // `map` is finished
  const std::vector<Piece> pieces = piecesIn(folder_ / "sparse");
  if (pieces.size() < 2) return 0;
  const fs::path result = folder_ / "joined.partial", attempt = folder_ / "joined.attempt";
  std::error_code status;
  fs::remove_all(result, status);
  Piece whole = pieces[0];
  std::vector<Piece> left(pieces.begin() + 1, pieces.end());
  int count = 0;
  // A model that cannot be joined with the first may be once others have been.
  for (bool joinsMore = true; joinsMore;) {
    joinsMore = false;
    for (auto piece = left.begin(); piece != left.end();) {
      size_t shared = 0;
      for (const int photo : piece->photos) shared += whole.photos.contains(photo) ? 1 : 0;
      if (shared < kLeastShared) {
        ++piece;
        continue;
      }
      fs::remove_all(attempt, status);
      makeFolder(attempt);
      runColmap(
          "joining",
          {"model_merger", "--input_path1", whole.folder.string(), "--input_path2", piece->folder.string(),
           "--output_path", attempt.string()},
          [&] { watch(0); }, [&] { return !photosIn(attempt).empty(); });
      // If it fails, it reports success and writes the first model.
      const std::set<int> photos = photosIn(attempt);
      if (photos.size() <= whole.photos.size() || !agreesWithGps(attempt, whole.folder)) {
        ++piece;
        continue;
      }
      piece = left.erase(piece);
      replaceFolder(attempt, result);
      whole = {result, photos};
      joinsMore = true;
      ++count;
    }
  }
  fs::remove_all(attempt, status);
  if (count == 0) return 0;
  // The models only share the poses of photos so far: their points are joined by the matches between them.
  const fs::path points = folder_ / "joined.points", adjusted = folder_ / "joined.adjusted";
  for (const fs::path& folder : {points, adjusted}) {
    removeFolder(folder);
    makeFolder(folder);
  }
  runColmap(
      "joining",
      {"point_triangulator", "--database_path", (folder_ / "database.db").string(), "--image_path",
       (folder_ / "images").string(), "--input_path", result.string(), "--output_path", points.string(),
       "--Mapper.num_threads", settings_.threadsText()},
      [&] { watch(0); }, [&] { return !photosIn(points).empty(); });
  adjustBundle("joining", points, adjusted, false, [&] { watch(0); });
  if (photosIn(adjusted).size() != whole.photos.size()) {
    throw Error(adjusted.string(), "", "lacks photos of the models that were joined",
                "see joining.log beside it; run again to go on");
  }
  discardAdjusted();
  replaceFolder(adjusted, folder_ / "joined");
  for (const fs::path& folder : {points, result}) fs::remove_all(folder, status);
  return count;
}

void PhotoModels::extend(bool resumes, const Watch& watch) {
  const fs::path input = last(false), partial = folder_ / "extended.partial";
  runMapper(input, partial, {}, resumes, watch);
  std::error_code status;
  if (photosIn(partial).size() >= photosIn(input).size()) {
    discardAdjusted();
    replaceFolder(partial, folder_ / "joined");
  }
  for (const char* name : {"extended.partial", "snapshots", "snapshot.begun"}) fs::remove_all(folder_ / name, status);
}

PhotoModels::Count PhotoModels::countMapped() const {
  std::set<int> photos;
  const std::vector<Piece> pieces = piecesIn(folder_ / "sparse");
  for (const Piece& piece : pieces) photos.insert(piece.photos.begin(), piece.photos.end());
  return {pieces.size(), photos.size()};
}

std::vector<int> PhotoModels::unplaced() const {
  const std::set<int> photos = photosIn(last(true));
  std::vector<int> missing;
  for (int i = 0; i < static_cast<int>(list_.photos.size()); ++i)
    if (!photos.contains(i)) missing.push_back(i);
  return missing;
}

std::vector<int> PhotoModels::placedApart() const {
  const std::set<int> photos = photosIn(last(true));
  std::set<int> apart;
  for (const Piece& piece : piecesIn(folder_ / "sparse"))
    for (const int photo : piece.photos)
      if (!photos.contains(photo)) apart.insert(photo);
  return {apart.begin(), apart.end()};
}

SourceCapture PhotoModels::readFrom(const fs::path& model) const {
  // The links in `images` lead out of that folder, which would be refused: photos get their own paths below.
  SourceCapture source = captureFromColmap(readColmapModel(model), folder_ / "named", folder_ / "masks");
  source.flight.assign(source.capture.photos.size(), 0);
  std::map<std::string, const ListedPhoto*> bySafeName;
  for (const ListedPhoto& photo : list_.photos) bySafeName[photo.safeName] = &photo;
  for (Photo& photo : source.capture.photos) {
    const auto listed = bySafeName.find(photo.image.filename().string());
    if (listed == bySafeName.end()) continue;
    photo.name = listed->second->name;
    photo.image = fs::absolute(listed->second->file);
    photo.gps = listed->second->tags.gps;
    photo.mask = listed->second->mask;
    source.flight[static_cast<size_t>(&photo - source.capture.photos.data())] = listed->second->flight;
  }
  return source;
}

SourceCapture PhotoModels::read() const {
  return readFrom(last(true));
}

}  // namespace tessera
