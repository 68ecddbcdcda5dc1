// SPDX-License-Identifier: BSL-1.0
#include <cles/registrar.hpp>

#include <string>
#include <utility>

namespace cles {

void registrar::on_bind(std::string_view task, task_info info) {
    add({.verb = verb::bind, .task = std::string{task}, .info = std::move(info)});
}

void registrar::add_task(cles::verb verb, std::string_view task, task_info& info,
                         detail::handler_functions& functions) {
    add({.verb = verb,
         .task = std::string{task},
         .info = std::move(info),
         .plain = std::move(functions.plain),
         .async = std::move(functions.async),
         .coroutine = functions.coroutine});
}

} // namespace cles
