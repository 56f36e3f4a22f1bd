// What a model is made of: its configuration and its named parameters in double precision.
#pragma once

#include <Eigen/Core>
#include <bitr/model.hpp>
#include <map>
#include <string>

namespace bitr::model {

struct Weights {
  ModelConfig config;
  Mode mode = Mode::scale_exact;
  std::string name;
  bool trained = true;
  /// By canonical official name; a 1-D tensor is one column.
  std::map<std::string, Eigen::MatrixXd> parameters;
  /// Free-form metadata of the file, kept when it is written again.
  std::map<std::string, std::string> metadata;
};

}  // namespace bitr::model
