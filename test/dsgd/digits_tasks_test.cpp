// SPDX-License-Identifier: BSL-1.0
#include <cles/service.hpp>
#include <cles/setting_error.hpp>

#include "digits/descent.hpp"
#include "digits/order.hpp"
#include "digits/tasks.hpp"
#include "support/answer.hpp"
#include "support/asked_node.hpp"
#include "support/run_until.hpp"

#include <boost/asio/io_context.hpp>
#include <boost/test/unit_test.hpp>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

#include <unistd.h>

namespace digits_tasks {
namespace {

// A file of images, until this is destroyed.
struct file {
    std::filesystem::path path;

    explicit file(const std::string& text) {
        std::string name = (std::filesystem::temp_directory_path() / "cles-digits-XXXXXX").string();
        const int made = ::mkstemp(name.data());
        BOOST_REQUIRE(made != -1);
        ::close(made);
        path = name;
        std::ofstream{path} << text;
    }
    file(const file&) = delete;
    file& operator=(const file&) = delete;
    ~file() { std::filesystem::remove(path); }
};

std::string images() {
    std::string out = "pixels=2,brightest=4,classes=2\n";
    for (int i = 0; i < 100; ++i) {
        out += std::to_string(i % 5) + "," + std::to_string((i * 7) % 5) + "," + std::to_string(i % 2) + "\n";
    }
    return out;
}

struct fixture : cles::test::asked_node {
    file data{images()};
    digits::network start = digits::made({.inputs = 2, .hidden = 3, .classes = 2}, 1);

    fixture() { digits::register_tasks(node, {.files = {data.path.string()}}); }

    std::string train(const digits::order& what) { return ask("DELEGATE self:digits/train " + cles::to_json(what)); }
};

} // namespace
} // namespace digits_tasks

BOOST_FIXTURE_TEST_SUITE(digits_tasks, fixture)

BOOST_AUTO_TEST_CASE(its_jobs_stay_on_this_node) {
    BOOST_TEST(ask("PULL self:cles").find("\"local\":true") != std::string::npos);
}

BOOST_AUTO_TEST_CASE(it_tells_what_it_has_but_no_image) {
    BOOST_TEST(ask("PULL self:digits") == R"({"images":100,"pixels":2,"classes":2})");
}

BOOST_AUTO_TEST_CASE(a_network_is_trained_further) {
    const auto answer =
        cles::from_json<digits::trained>(train({.start = to_model(start), .passes = 3, .rate = 0.1, .seed = 9}));
    const auto all = digits::image_set::parse(digits_tasks::images(), "images");
    digits::descent work{all, start, {.passes = 3, .rate = 0.1, .seed = 9}};
    while (work.step()) {
    }
    BOOST_TEST((from_model(answer.result) == work.result())); // bit by bit
    BOOST_TEST(answer.node == "node");
    BOOST_TEST(answer.images == 100U);
    BOOST_TEST(answer.steps == 300U);
    BOOST_TEST(answer.loss == work.mean_loss());
    BOOST_TEST(answer.ms > 0);
}

BOOST_AUTO_TEST_CASE(what_cannot_be_is_refused) {
    const auto other = to_model(digits::made({.inputs = 3, .hidden = 3, .classes = 2}, 1));
    auto broken = to_model(start);
    broken.weights.pop_back();
    BOOST_TEST(ask("DELEGATE self:digits {}").starts_with("bad_request"));
    BOOST_TEST(ask("DELEGATE self:digits/test {}").starts_with("bad_request"));
    BOOST_TEST(ask("DELEGATE self:digits/train {}").starts_with("bad_request"));
    BOOST_TEST(train({.start = other}) == "bad_request: node: this node's images have 2 pixels, and are of 2 classes");
    BOOST_TEST(train({.start = broken}).starts_with("bad_request: node: start: weights: not 17 numbers"));
    BOOST_TEST(train({.start = to_model(start), .passes = 0}) == "bad_request: node: passes: 1 to 10000");
    BOOST_TEST(train({.start = to_model(start), .rate = -1}) == "bad_request: node: rate: more than 0");
}

BOOST_AUTO_TEST_CASE(a_rate_that_is_too_large_fails) {
    BOOST_TEST(train({.start = to_model(start), .passes = 100, .rate = 1e9}) ==
               "failed: node: it does not converge: the rate is too large");
}

BOOST_AUTO_TEST_CASE(it_tells_how_far_it_is) {
    double last = 0;
    cles::test::answer<> a;
    node.async_request("DELEGATE self:digits/train " +
                           cles::to_json(digits::order{.start = to_model(start), .passes = 200}),
                       a.options().on_progress([&](double part, std::string_view) {
                           BOOST_TEST(part > last);
                           last = part;
                       }),
                       a.take());
    cles::test::run_until(io, [&] { return a.done(); });
    BOOST_TEST(last > 0.8);
}

BOOST_AUTO_TEST_CASE(files_are_needed_and_checked) {
    cles::service other{io, {.name = "other"}};
    BOOST_CHECK_THROW(digits::register_tasks(other, {}), cles::setting_error);
    BOOST_CHECK_THROW(digits::register_tasks(other, {.files = {"/nonexistent"}}), cles::setting_error);
    const digits_tasks::file broken{"pixels=2,brightest=4,classes=2\n1,2\n"};
    BOOST_CHECK_THROW(digits::register_tasks(other, {.files = {broken.path.string()}}), cles::setting_error);
}

BOOST_AUTO_TEST_SUITE_END()
