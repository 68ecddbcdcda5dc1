// SPDX-License-Identifier: BSL-1.0
#include "serve/demo_tasks.hpp"

#include <cles/registrar.hpp>

#include "serve/sleep_job.hpp"

#include <boost/describe.hpp>

#include <string>
#include <vector>

namespace tool {
namespace {

struct echoed {
    std::vector<std::string> parameters;
};
BOOST_DESCRIBE_STRUCT(echoed, (), (parameters))

} // namespace

void register_play_tasks(cles::registrar& tasks) {
    const auto body = [](const cles::request& r) { return cles::json_text{std::string{r.body()}}; };
    tasks.on_pull("echo",
                  [](const cles::request& r) {
                      return echoed{{r.parameters().begin(), r.parameters().end()}};
                  },
                  {.description = "Gives its parameters back", .parameters = {"any"}, .idempotent = true});
    tasks.on_push("echo", body, {.description = "Gives its body back", .idempotent = true});
    tasks.on_delegate("echo", body, {.description = "Gives its body back", .idempotent = true});
    tasks.on_delegate("sleep",
                      [](const cles::request& r, cles::responder answer) { sleep_job::start(r, std::move(answer)); },
                      {.description = "Takes so many milliseconds, with progress in tenths",
                       .parameters = {"ms"},
                       .idempotent = true});
    tasks.on_delegate("fail",
                      [](const cles::request&) { throw cles::error(cles::errc::failed, "this task always fails"); },
                      {.description = "Fails", .idempotent = true});
    tasks.on_update("notice", [](const cles::request&) {}, {.description = "Passes a notice on to all that are bound"});
}

} // namespace tool
