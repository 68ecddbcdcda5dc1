// SPDX-License-Identifier: BSL-1.0
// A plugin whose workers hang: it offers `sgd` with the default data, and answers no DELEGATE until it is withdrawn.
#include <cles/plugin.hpp>
#include <cles/version.hpp>

#include "sgd/data_set.hpp"

#include <chrono>
#include <thread>

namespace {

void hang(const cles::request&, const cles::responder& answer) {
    while (!answer.stopped()) {
        std::this_thread::sleep_for(std::chrono::milliseconds{5});
    }
}

void register_tasks(cles::registrar& to) {
    to.on_pull("sgd", [] { return sgd::recipe{}; }, {.idempotent = true, .inline_ok = true});
    to.on_delegate("sgd", hang, {.parameters = {"train"}, .idempotent = true, .local = true});
}

} // namespace

CLES_PLUGIN("hanging", cles::version, register_tasks)
