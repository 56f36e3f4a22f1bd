#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bitr/confidence.hpp>
#include <bitr/data.hpp>
#include <bitr/evaluate.hpp>
#include <bitr/generate.hpp>
#include <cmath>
#include <limits>
#include <numbers>

#include "confidence/ensemble.hpp"
#include "core/select_rows.hpp"
#include "support/random_motion.hpp"
#include "support/turn.hpp"

namespace bitr {
namespace {

using testing::HasSubstr;
using testing::IsEmpty;

Confidence judged(const PointCloud& source, const PointCloud& reference, const Pose& pose,
                  const std::optional<NetworkEvidence>& network = {}, unsigned threads = 1) {
  const CloudPair pair = {source, reference};
  auto result = judge_poses(cpu_device(threads), {&pair, 1}, {&pose, 1}, {&network, 1});
  EXPECT_TRUE(result) << (result ? "" : result.error().message);
  return result->front();
}

PointCloud moved(const PointCloud& cloud, const Pose& motion, double scale = 1) {
  PointCloud result = cloud;
  for (Vec3d& point : result.positions) {
    for (double& x : point) x *= scale;
    point = motion.apply(point);
  }
  for (Vec3f& normal : result.normals) {
    const Vec3d turned = motion.rotate({normal[0], normal[1], normal[2]});
    for (int a = 0; a < 3; ++a) normal[a] = static_cast<float>(turned[a]);
  }
  return result;
}

/// Even points of a sphere, with outward normals.
PointCloud sphere(std::size_t count, double radius) {
  PointCloud cloud;
  for (std::size_t i = 0; i < count; ++i) {
    const double z = 1 - (2 * static_cast<double>(i) + 1) / static_cast<double>(count);
    const double angle = 2.399963229728653 * static_cast<double>(i), r = std::sqrt(1 - z * z);
    const Vec3d n = {r * std::cos(angle), r * std::sin(angle), z};
    cloud.positions.push_back({radius * n[0], radius * n[1], radius * n[2]});
    cloud.normals.push_back({static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
  }
  return cloud;
}

/// A square sheet of side × side points one apart, from x = first on, normals up.
PointCloud sheet(int side, double first) {
  PointCloud cloud;
  for (int i = 0; i < side; ++i)
    for (int j = 0; j < side; ++j) {
      cloud.positions.push_back({first + i, static_cast<double>(j), 0});
      cloud.normals.push_back({0, 0, 1});
    }
  return cloud;
}

GeneratedPair aircraft(std::uint64_t seed, double share = 0.7, std::size_t points = 400) {
  GenerateOptions options;
  options.points = points;
  options.noise = 0.005;
  options.seed = seed;
  options.protocol = Protocol::opposed;
  options.share = share;
  return generate_pair("aircraft", options).value();
}

TEST(Evidence, OfACopyIsPerfect) {
  const PointCloud cloud = sphere(500, 2);
  const Evidence evidence = judged(cloud, cloud, {}).evidence;
  EXPECT_NEAR(evidence.score, 1, 1e-6);
  EXPECT_DOUBLE_EQ(evidence.overlap, 1);
  EXPECT_EQ(evidence.interpenetration, 0);
  EXPECT_FALSE(evidence.rims);  // a sphere has none
  EXPECT_GT(judged(cloud, cloud, {}).value, 0.8);
  EXPECT_FALSE(evidence.rotation_spread || evidence.translation_spread || evidence.rotation_gap ||
               evidence.refined_by);
}

TEST(Evidence, IsTheSameInEveryFrameAndUnit) {
  Random random(3);
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    const GeneratedPair pair = aircraft(seed);
    const Pose off = test::random_pose(random, 0.02);
    const Pose pose = seed % 2 ? pair.T_reference_source * off : pair.T_reference_source;
    const Evidence expected = judged(pair.source, pair.reference, pose).evidence;
    const double scale = 1000;
    const Pose a = test::random_pose(random, 5), b = test::random_pose(random, 5);
    Pose scaled = pose;
    for (double& t : scaled.translation) t *= scale;
    const Evidence found =
        judged(moved(pair.source, a, scale), moved(pair.reference, b, scale), b * scaled * a.inverse())
            .evidence;
    EXPECT_NEAR(found.score, expected.score, 1e-5);
    EXPECT_NEAR(found.overlap, expected.overlap, 1e-5);
    EXPECT_NEAR(found.rims.value(), expected.rims.value(), 1e-5);
    EXPECT_NEAR(found.interpenetration, expected.interpenetration, 1e-5);
  }
}

TEST(Evidence, TellsWhatLiesInside) {
  // All of the smaller sphere is under the larger one's surface, and nothing of the larger one is.
  const PointCloud small = sphere(600, 0.7), large = sphere(600, 2);
  EXPECT_NEAR(judged(small, large, {}).evidence.interpenetration, 0.5, 0.01);
  EXPECT_NEAR(judged(large, small, {}).evidence.interpenetration, 0.5, 0.01);
  Pose beside;
  beside.translation = {3, 0, 0};
  EXPECT_EQ(judged(small, large, beside).evidence.interpenetration, 0);
  PointCloud bare = small;
  bare.normals.clear();
  EXPECT_EQ(judged(bare, large, {}).evidence.interpenetration, 0);
}

TEST(Evidence, SeesRimsThatMeet) {
  const PointCloud left = sheet(24, 0);
  // Sides against each other share one of four rims; far away none; on one another all.
  const double met = judged(left, sheet(24, 24), {}).evidence.rims.value();
  EXPECT_GT(met, 0.2);
  EXPECT_LT(met, 0.6);
  EXPECT_EQ(judged(left, sheet(24, 100), {}).evidence.rims, 0);
  EXPECT_EQ(judged(left, left, {}).evidence.rims, 1);
}

TEST(Confidence, FallsWithTheEvidence) {
  const GeneratedPair pair = aircraft(1);
  const Pose& truth = pair.T_reference_source;
  const auto with = [&](double gap, double degrees, double translation) {
    return judged(pair.source, pair.reference, truth, NetworkEvidence{truth, gap, degrees, translation});
  };
  const Confidence good = with(1.9, 3, 0.01);
  EXPECT_GT(good.value, 0.9);
  EXPECT_THAT(good.reasons, IsEmpty());
  EXPECT_EQ(good.evidence.rotation_spread, 3);
  EXPECT_EQ(good.evidence.translation_spread, 0.01);
  EXPECT_FALSE(good.evidence.refined_by);
  double last = 1;
  for (const double degrees : {3., 10., 30., 90.}) {
    const Confidence confidence = with(1.9, degrees, 0.01);
    EXPECT_LT(confidence.value, last);
    last = confidence.value;
  }
  EXPECT_LT(with(1.9, 3, 0.3).value, good.value);
  EXPECT_LT(with(1, 3, 0.01).value, good.value);
  const Confidence doubtful = with(0.2, 90, 0.5);
  EXPECT_LT(doubtful.value, 0.2);
  EXPECT_THAT(doubtful.reasons,
              testing::UnorderedElementsAre(HasSubstr("differ by 90°"), HasSubstr("50 % of their radius"),
                                            HasSubstr("gap 0.20")));
}

TEST(Confidence, IsNoneOfARotationThatIsNotDetermined) {
  const GeneratedPair pair = aircraft(1);
  const auto with = [&](double gap) {
    return judged(pair.source, pair.reference, pair.T_reference_source,
                  NetworkEvidence{pair.T_reference_source, gap, 3, 0.01});
  };
  EXPECT_GT(with(1.1e-3).value, 0);
  EXPECT_EQ(with(0.9e-3).value, 0);
  EXPECT_EQ(with(0.9e-3).reasons.front(), "the rotation is not determined");
}

TEST(Confidence, SaysHowFarRefinementTurned) {
  const GeneratedPair pair = aircraft(2);
  Pose start = pair.T_reference_source;
  start.rotation = {1, 0, 0, 0, 0, -1, 0, 1, 0};
  const double turned = rotation_error_degrees(start, pair.T_reference_source);
  const Confidence confidence =
      judged(pair.source, pair.reference, pair.T_reference_source, NetworkEvidence{start, 1.9, 3, 0.01});
  EXPECT_DOUBLE_EQ(confidence.evidence.refined_by.value(), turned);
  EXPECT_THAT(confidence.reasons, testing::Contains(HasSubstr("refinement turned")));
}

TEST(Confidence, IsNoneOfAPoseThatIsNotFinite) {
  const PointCloud cloud = sphere(50, 1);
  Pose pose;
  pose.translation[1] = std::numeric_limits<double>::quiet_NaN();
  const Confidence confidence = judged(cloud, cloud, pose);
  EXPECT_EQ(confidence.value, 0);
  EXPECT_THAT(confidence.reasons, testing::ElementsAre(HasSubstr("not finite")));
}

TEST(Confidence, DoesNotDependOnThreadsNorOnOtherPairs) {
  std::vector<GeneratedPair> pairs;
  for (std::uint64_t seed = 0; seed < 5; ++seed) pairs.push_back(aircraft(seed, 0.6));
  std::vector<CloudPair> views;
  std::vector<Pose> poses;
  for (const GeneratedPair& pair : pairs) {
    views.push_back({pair.source, pair.reference});
    poses.push_back(pair.T_reference_source);
  }
  const auto together = judge_poses(cpu_device(2), views, poses).value();
  for (std::size_t i = 0; i < pairs.size(); ++i)
    EXPECT_EQ(together[i].value, judged(pairs[i].source, pairs[i].reference, poses[i], {}, 7).value);
}

TEST(Confidence, NamesWhatIsWrong) {
  const PointCloud cloud = sphere(50, 1), two = sphere(2, 1);
  const std::vector<CloudPair> pairs = {{cloud, cloud}, {two, cloud}};
  const std::vector<Pose> poses(2);
  const auto error = [&](auto&&... arguments) {
    return judge_poses(cpu_device(1), arguments...).error().message;
  };
  EXPECT_EQ(error(pairs, poses), "pair 1: source: 2 points; at least 3 are needed");
  EXPECT_THAT(error(pairs, std::vector<Pose>(1)), HasSubstr("1 poses"));
}

Assembly answer_of(const Pose& pose, double gap) {
  Assembly answer;
  answer.T_reference_source = pose;
  answer.diagnostics.rotation_gap = gap;
  return answer;
}

Pose shift(double x, double y, double z) {
  Pose pose;
  pose.translation = {x, y, z};
  return pose;
}

TEST(Ensemble, MeanIsWeightedByTheGaps) {
  const PointCloud cloud = sphere(100, 1);
  confidence::Ensemble shifted({cloud, cloud}), turned({cloud, cloud});
  shifted.add(answer_of(shift(1, 0, 0), 1.5));
  shifted.add(answer_of(shift(-1, 0, 0), 0.5));
  EXPECT_NEAR(shifted.together().T_reference_source.translation[0], 0.5, 1e-12);
  EXPECT_DOUBLE_EQ(shifted.together().rotation_gap, 1);
  turned.add(answer_of(test::turn_about({0, 0, 1}, 60), 1.5));
  turned.add(answer_of(test::turn_about({0, 0, 1}, -60), 0.5));
  // The direction of 1.5 e^{i60°} + 0.5 e^{−i60°}.
  const double expected = std::atan2(std::sqrt(3) / 2, 1) * 180 / std::numbers::pi;
  EXPECT_NEAR(
      rotation_error_degrees(turned.together().T_reference_source, test::turn_about({0, 0, 1}, expected)), 0,
      1e-6);
}

TEST(Ensemble, FirstOneCountsWhereNoneIsDetermined) {
  const PointCloud cloud = sphere(100, 1);
  confidence::Ensemble ensemble({cloud, cloud});
  ensemble.add(answer_of(test::turn_about({0, 0, 1}, 20), 0));
  ensemble.add(answer_of(test::turn_about({0, 0, 1}, 80), 0));
  EXPECT_EQ(ensemble.together().T_reference_source.matrix(), test::turn_about({0, 0, 1}, 20).matrix());
  EXPECT_EQ(ensemble.together().rotation_gap, 0);
}

TEST(Ensemble, SpreadsAreAnAngleAndAShareOfTheRadius) {
  // Corners of cubes, 2√3 and √3 from their middles: a radius of √15.
  const auto cube = [](double half, const Vec3d& middle) {
    PointCloud cloud;
    for (int corner = 0; corner < 8; ++corner) {
      const auto at = [&](int axis) {
        return static_cast<float>(middle[axis] + (corner >> axis & 1 ? half : -half));
      };
      cloud.positions.push_back({at(0), at(1), at(2)});
    }
    return cloud;
  };
  const PointCloud source = cube(2, {0, 0, 0}), reference = cube(1, {4, 0, 0});
  confidence::Ensemble ensemble({source, reference});
  for (const double degrees : {10., -10.}) ensemble.add(answer_of(test::turn_about({0, 0, 1}, degrees), 1));
  const NetworkEvidence evidence = ensemble.together();
  EXPECT_NEAR(evidence.rotation_spread, 10, 1e-9);
  // The source's middle stays in all of them and in the mean's turn; the reference's goes back to
  // 4 (cos 10°, ± sin 10°), which asks the mean for a step of its own, half of it heeded.
  const double c = std::cos(std::numbers::pi / 18), s = std::sin(std::numbers::pi / 18);
  const double step = 0.5 * (4 - 4 * c);
  const double there = step, back = std::hypot(4 - step - 4 * c, 4 * s);
  EXPECT_NEAR(evidence.T_reference_source.translation[0], step, 1e-6);
  EXPECT_NEAR(evidence.translation_spread, std::sqrt((there * there + back * back) / 2 / 15), 1e-6);
}

TEST(Ensemble, FailedOnesSpeakAgainstThePose) {
  const PointCloud cloud = sphere(100, 1);
  confidence::Ensemble ensemble({cloud, cloud});
  ensemble.add(answer_of({}, 1.8));
  Assembly failed = answer_of({}, std::numeric_limits<double>::quiet_NaN());
  failed.T_reference_source.translation[0] = std::numeric_limits<double>::quiet_NaN();
  failed.status = Status::failed;
  ensemble.add(failed);
  ensemble.add(failed);
  const NetworkEvidence evidence = ensemble.together();
  EXPECT_EQ(evidence.rotation_spread, 180);
  EXPECT_DOUBLE_EQ(evidence.rotation_gap, 0.6);
  EXPECT_EQ(evidence.translation_spread, 0);
  EXPECT_EQ(evidence.T_reference_source.matrix(), Pose().matrix());
}

class Resample : public testing::Test {
 protected:
  Plan plan(const Model& model, std::span<const CloudPair> pairs) {
    return make_plan(cpu_device(1), model, shape_of(pairs)).value();
  }
};

TEST_F(Resample, TellsSettledAnswersFromVagueOnes) {
  const Model model = shipped_model("aircraft").value();
  const GeneratedPair known = aircraft(5);
  const PointCloud ball = sphere(300, 0.5), other_ball = sphere(280, 0.5);
  const std::vector<CloudPair> pairs = {{known.source, known.reference}, {ball, other_ball}};
  Plan made = plan(model, pairs);
  const auto assemblies = assemble(made, pairs).value();
  const auto timings = made.timings();
  const auto evidence = resample(made, pairs, assemblies).value();
  ASSERT_TRUE(evidence[0] && evidence[1]);
  EXPECT_LT(evidence[0]->rotation_spread, 20);
  EXPECT_GT(evidence[0]->rotation_spread, 0);
  EXPECT_GT(evidence[1]->rotation_spread, 30);  // a ball has no answer
  EXPECT_GT(evidence[0]->translation_spread, 0);
  EXPECT_LT(evidence[0]->translation_spread, 0.2);
  EXPECT_GT(evidence[0]->rotation_gap, evidence[1]->rotation_gap);
  // The plan still tells of the assembly.
  ASSERT_EQ(made.timings().size(), timings.size());
  for (std::size_t i = 0; i < timings.size(); ++i)
    EXPECT_EQ(made.timings()[i].milliseconds, timings[i].milliseconds);

  EXPECT_EQ(resample(made, pairs, assemblies).value()[0]->rotation_spread, evidence[0]->rotation_spread);
  EXPECT_NE(resample(made, pairs, assemblies, {.seed = 9}).value()[0]->rotation_spread,
            evidence[0]->rotation_spread);
  const auto alone = resample(made, {pairs.data(), 1}, {assemblies.data(), 1}).value();
  EXPECT_NEAR(alone[0]->rotation_spread, evidence[0]->rotation_spread, 1e-3);
}

PointCloud permuted(const PointCloud& cloud, Random& random) {
  std::vector<std::size_t> rows(cloud.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    rows[i] = i;
    std::swap(rows[i], rows[random.below(i + 1)]);
  }
  return select_rows(cloud, rows);
}

double turned(const Pose& a, const Pose& b) { return rotation_error_degrees(a, b); }

TEST_F(Resample, MeanTurnsWithTheCloudsIsInvertedWithThemAndIgnoresTheirOrder) {
  const Model model = shipped_model("aircraft").value();
  Random random(8);
  for (std::uint64_t seed = 1; seed < 4; ++seed) {
    const GeneratedPair pair = aircraft(seed, 0.6);
    const Pose a = test::random_pose(random, 5), b = test::random_pose(random, 5);
    const PointCloud source = moved(pair.source, a), reference = moved(pair.reference, b);
    const PointCloud shuffled = permuted(pair.source, random);
    const std::vector<CloudPair> pairs = {{pair.source, pair.reference},
                                          {source, reference},
                                          {pair.reference, pair.source},
                                          {shuffled, pair.reference}};
    Plan made = make_plan(cpu_device(1), model, shape_of(pairs), {.precision = Precision::f64}).value();
    const auto mean = resample(made, pairs, assemble(made, pairs).value()).value();
    for (const auto& same : mean) {
      EXPECT_NEAR(same->rotation_gap, mean[0]->rotation_gap, 1e-4);
      EXPECT_NEAR(same->rotation_spread, mean[0]->rotation_spread, 1e-3);
      EXPECT_NEAR(same->translation_spread, mean[0]->translation_spread, 1e-5);
    }
    const Pose first = mean[0]->T_reference_source;
    const Pose expected = b * first * a.inverse();
    EXPECT_LT(turned(mean[1]->T_reference_source, expected), 1e-3);  // normals are floats
    EXPECT_LT(translation_error(mean[1]->T_reference_source, expected), 1e-4);
    EXPECT_LT(turned(mean[2]->T_reference_source, first.inverse()), 1e-6);
    EXPECT_LT(translation_error(mean[2]->T_reference_source, first.inverse()), 1e-8);
    EXPECT_LT(turned(mean[3]->T_reference_source, first), 1e-6);
    EXPECT_LT(translation_error(mean[3]->T_reference_source, first), 1e-8);
  }
}

TEST_F(Resample, MeanIsNearerTheTruth) {
  const Model model = shipped_model("aircraft").value();
  double one = 0, mean = 0;
  for (std::uint64_t seed = 100; seed < 140; ++seed) {
    const GeneratedPair pair = aircraft(seed, 0.7, 768);
    const CloudPair clouds = {pair.source, pair.reference};
    Plan made = plan(model, {&clouds, 1});
    const auto assemblies = assemble(made, {&clouds, 1}).value();
    const auto evidence = resample(made, {&clouds, 1}, assemblies).value();
    // Flips would rule the sums.
    one += std::min(30., turned(assemblies[0].T_reference_source, pair.T_reference_source));
    mean += std::min(30., turned(evidence[0]->T_reference_source, pair.T_reference_source));
  }
  EXPECT_LT(mean, one);
}

TEST_F(Resample, LeavesOutCloudsThatAreTooSmallForParts) {
  const Model model = shipped_model("aircraft").value();
  const std::size_t least =
      static_cast<std::size_t>(model.config().k_neighbor * model.config().neighbor_dilation + 1);
  const PointCloud small = sphere(least, 0.5), large = sphere(4 * least, 0.5);
  const std::vector<CloudPair> pairs = {{small, large}, {large, large}};
  Plan made = plan(model, pairs);
  const auto evidence = resample(made, pairs, assemble(made, pairs).value()).value();
  EXPECT_FALSE(evidence[0]);
  EXPECT_TRUE(evidence[1]);
}

TEST_F(Resample, NamesWhatIsWrong) {
  const Model model = shipped_model("aircraft").value();
  const GeneratedPair known = aircraft(5);
  const std::vector<CloudPair> pairs = {{known.source, known.reference}};
  Plan made = plan(model, pairs);
  const auto assemblies = assemble(made, pairs).value();
  const auto error = [&](const ResampleOptions& options) {
    return resample(made, pairs, assemblies, options).error().message;
  };
  for (const int answers : {0, -2, 7, 102})
    EXPECT_THAT(error({.answers = answers}),
                HasSubstr("answers " + std::to_string(answers) + " is not an even number in 2 … 100"));
  EXPECT_THAT(error({.share = 1}), HasSubstr("share 1.0"));
  EXPECT_THAT(resample(made, pairs, {}).error().message, HasSubstr("0 assemblies for 1 pairs"));
}

TEST(Confidence, TellsRightFromWrongOnShapesItHasNotSeen) {
  // A third of the object in each piece, which do not meet: about half of the answers are right.
  DataPart part;
  part.kind = "aircraft";
  part.protocol = Protocol::opposed;
  part.share_low = part.share_high = 0.3;
  const DataSet data = DataSet::open({.parts = {part},
                                      .split = Split::test,
                                      .points_low = 512,
                                      .points_high = 512,
                                      .noise = 0.01,
                                      .samples = 80,
                                      .seed = 21})
                           .value();
  const Model model = shipped_model("aircraft").value();
  std::vector<Judgement> judgements;
  for (std::size_t i = 0; i < data.samples(); ++i) {
    const DataSample sample = data.sample(0, i).value();
    const CloudPair pair = {sample.source, sample.reference};
    Plan plan = make_plan(cpu_device(1), model, shape_of({&pair, 1})).value();
    const auto assemblies = assemble(plan, {&pair, 1}, {.diagnostics = false}).value();
    const auto evidence = resample(plan, {&pair, 1}, assemblies).value();
    const Pose& pose = evidence[0]->T_reference_source;
    const auto confidence = judge_poses(cpu_device(1), {&pair, 1}, {&pose, 1}, evidence).value();
    judgements.push_back({confidence[0].value, near_truth(errors_of(pose, sample))});
  }
  const ConfidenceSummary summary = summarise_confidence(judgements);
  EXPECT_GT(summary.area.value(), 0.75);
  EXPECT_NEAR(summary.said, summary.was, 0.2);
}

}  // namespace
}  // namespace bitr
