// SPDX-License-Identifier: BSL-1.0
#include <cles/plugin.hpp>

#include <boost/describe/class.hpp>

#include <optional>
#include <string>

// The settings under `config` in the configuration; all are optional.
struct settings {
    std::optional<std::string> greeting;
};
BOOST_DESCRIBE_STRUCT(settings, (), (greeting))

struct leg {
    double km = 0, kmh = 0;
};
BOOST_DESCRIBE_STRUCT(leg, (), (km, kmh))

// Called once. The handlers run on several threads at the same time.
void register_tasks(cles::registrar& to, const settings& wanted) {
    // PULL node:hello/you
    to.on_pull("hello",
               [greeting = wanted.greeting.value_or("Hello")](const cles::request& asked) {
                   return greeting + ", " + asked.parameter<std::string>(0) + "!";
               },
               {.description = "Greets the name that is given", .parameters = {"name"}});

    // DELEGATE node:minutes {"km":30,"kmh":60}
    to.on_delegate("minutes",
                   [](const leg& l) {
                       if (l.kmh <= 0) {
                           throw cles::error(cles::errc::bad_request, "kmh must be more than 0");
                       }
                       return l.km / l.kmh * 60;
                   },
                   {.description = "Time for a leg", .idempotent = true});

    // PUSH node:notice {"text":"..."}, which is published to all subscribers of `notice`.
    to.on_bind("notice", {.description = "What was pushed last"});
    to.on_push("notice", [updates = to.make_publisher()](const cles::request& asked) {
        updates.update("notice", cles::json_text{std::string{asked.body()}});
    });
}

CLES_PLUGIN("my_plugin", "1.0", register_tasks)
