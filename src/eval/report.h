// report.html: an evaluation for people. One file with everything inside, that works offline and without scripts:
// summary, a table with the worst views first, and for each view photo, rendering, error and depth side by side.
#pragma once

#include <map>
#include <string>

#include "eval/evaluate.h"

namespace tessera {

// Collects reduced pictures while `evaluate` runs, so that no view's full pictures are kept:
//   ReportBuilder builder("fox", capture.photosIn(split).size());
//   options.onView = [&](const ViewResult& result, const ViewPictures& pictures) { builder.add(result, pictures); };
//   builder.write("report.html", evaluate(renderer, capture, options));
class ReportBuilder {
 public:
  // `title`: what was judged. `expectedViews` sets the size of the pictures: the more views, the smaller, so that the
  // file stays within some tens of megabytes.
  ReportBuilder(std::string title, size_t expectedViews);

  void add(const ViewResult& result, const ViewPictures& pictures);
  // Views that were never added have numbers but no pictures.
  std::string html(const EvaluationReport& report) const;
  void write(const fs::path& path, const EvaluationReport& report) const;

 private:
  struct Figure {
    std::string caption;
    Bytes jpeg;
    int width = 0, height = 0;
  };

  Figure figure(std::string caption, const ImageU8& image) const;

  std::string title_;
  int longestSide_;
  std::map<std::string, std::vector<Figure>> figures_;  // by view name
};

}  // namespace tessera
