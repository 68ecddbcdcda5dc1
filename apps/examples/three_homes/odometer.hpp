// SPDX-License-Identifier: BSL-1.0
// Tasks that know nothing of where they live.
#pragma once

#include <cles/registrar.hpp>

#include <boost/describe/class.hpp>

#include <memory>
#include <mutex>

struct trip {
    double km = 0;
};
BOOST_DESCRIBE_STRUCT(trip, (), (km))

inline void register_odometer(cles::registrar& to) {
    // In a plugin, several threads call the handlers, so shared data needs a mutex.
    struct odometer {
        std::mutex mutex;
        double km = 0;
    };
    const auto shared = std::make_shared<odometer>();

    to.on_push("drive", [shared, updates = to.make_publisher()](const trip& t) {
        const std::scoped_lock lock{shared->mutex};
        shared->km += t.km;
        updates.update("odometer", shared->km);
        return shared->km;
    });
    to.on_bind("odometer", {.description = "Kilometres driven"});
    // Waits for an answer without holding a thread meanwhile.
    to.on_delegate("there_and_back", [](const cles::request& asked, const cles::responder& answer) {
        const trip there = asked.as<trip>();
        answer.delegate("PUSH self:drive " + cles::to_json(there),
                        [answer, there](boost::system::error_code failed, std::string_view, std::string_view words) {
                            if (failed) {
                                answer.fail(cles::errc::failed, words);
                                return;
                            }
                            answer.progress(0.5);
                            answer.done(2 * there.km);
                        });
    });
}
