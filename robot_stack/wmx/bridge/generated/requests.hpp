// Requests that are one call of the vendor's library each.
// Written by robot_stack/wmx/bridge/generate.py. Do not edit.

#pragma once

inline const std::unordered_map<std::string_view, Request> REQUESTS = {
    {"CoreMotion.ExecEStop",
     {1, 1555, [](Session& s, const List& a, List&) {
          return s.core.ExecEStop(named<EStopLevel::T>(a[0]));
      }}},
    {"CoreMotion.ReleaseEStop",
     {0, 1555, [](Session& s, const List&, List&) {
          return s.core.ReleaseEStop();
      }}},
    {"axisControl.SetServoOn",
     {2, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.axisControl->SetServoOn(axes, whole(a[1])); });
      }}},
    {"axisControl.ClearAmpAlarm",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.axisControl->ClearAmpAlarm(axes); });
      }}},
    {"axisControl.ClearAxisAlarm",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.axisControl->ClearAxisAlarm(axes); });
      }}},
    {"axisControl.SetAxisCommandMode",
     {2, 1555, [](Session& s, const List& a, List&) {
          return s.core.axisControl->SetAxisCommandMode(whole(a[0]), named<AxisCommandMode::T>(a[1]));
      }}},
    {"motion.Stop",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.motion->Stop(axes); });
      }}},
    {"motion.ExecQuickStop",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.motion->ExecQuickStop(axes); });
      }}},
    {"motion.StartPos",
     {1, 1555, [](Session& s, const List& a, List&) {
          return commands<Motion::PosCommand>(a[0], [&](auto... c) { return s.core.motion->StartPos(c...); });
      }}},
    {"motion.StartMov",
     {1, 1555, [](Session& s, const List& a, List&) {
          return commands<Motion::PosCommand>(a[0], [&](auto... c) { return s.core.motion->StartMov(c...); });
      }}},
    {"velocity.Stop",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.velocity->Stop(axes); });
      }}},
    {"velocity.ExecQuickStop",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.velocity->ExecQuickStop(axes); });
      }}},
    {"velocity.StartVel",
     {1, 1555, [](Session& s, const List& a, List&) {
          return commands<Velocity::VelCommand>(a[0], [&](auto... c) { return s.core.velocity->StartVel(c...); });
      }}},
    {"velocity.StartVel_TimedVel",
     {1, 1555, [](Session& s, const List& a, List&) {
          return commands<Velocity::TimedVelCommand>(a[0], [&](auto... c) { return s.core.velocity->StartVel(c...); });
      }}},
    {"home.StartHome",
     {1, 1555, [](Session& s, const List& a, List&) {
          return on_axes(a[0], [&](auto axes) { return s.core.home->StartHome(axes); });
      }}},
    {"home.Cancel",
     {1, 1555, [](Session& s, const List& a, List&) {
          return s.core.home->Cancel(whole(a[0]));
      }}},
    {"home.SetCommandPos",
     {2, 1555, [](Session& s, const List& a, List&) {
          return s.core.home->SetCommandPos(whole(a[0]), finite(a[1], 65580));
      }}},
    {"config.SetGearRatio",
     {3, 1555, [](Session& s, const List& a, List&) {
          return s.core.config->SetGearRatio(whole(a[0]), finite(a[1], 1555), finite(a[2], 1555));
      }}},
    {"config.GetGearRatio",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<double, double>(out, [&](auto*... p) { return s.core.config->GetGearRatio(whole(a[0]), p...); });
      }}},
    {"config.SetAxisPolarity",
     {2, 1555, [](Session& s, const List& a, List&) {
          return s.core.config->SetAxisPolarity(whole(a[0]), narrow<signed char>(a[1]));
      }}},
    {"config.GetAxisPolarity",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<char>(out, [&](auto*... p) { return s.core.config->GetAxisPolarity(whole(a[0]), p...); });
      }}},
    {"config.GetFeedbackParam",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<Config::FeedbackParam>(out, [&](auto*... p) { return s.core.config->GetFeedbackParam(whole(a[0]), p...); });
      }}},
    {"config.GetHomeParam",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<Config::HomeParam>(out, [&](auto*... p) { return s.core.config->GetHomeParam(whole(a[0]), p...); });
      }}},
    {"config.GetLimitParam",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<Config::LimitParam>(out, [&](auto*... p) { return s.core.config->GetLimitParam(whole(a[0]), p...); });
      }}},
    {"config.GetMotionParam",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<Config::MotionParam>(out, [&](auto*... p) { return s.core.config->GetMotionParam(whole(a[0]), p...); });
      }}},
    {"config.GetAlarmParam",
     {1, 1555, [](Session& s, const List& a, List& out) {
          return answer<Config::AlarmParam>(out, [&](auto*... p) { return s.core.config->GetAlarmParam(whole(a[0]), p...); });
      }}},
    {"config.SetFeedbackParam",
     {2, 65536, [](Session& s, const List& a, List&) {
          return change<Config::FeedbackParam>(a[1],
                 [&](auto* p) { return s.core.config->GetFeedbackParam(whole(a[0]), p); },
                 [&](auto* p) { return s.core.config->SetFeedbackParam(whole(a[0]), p); });
      }}},
    {"config.SetHomeParam",
     {2, 65536, [](Session& s, const List& a, List&) {
          return change<Config::HomeParam>(a[1],
                 [&](auto* p) { return s.core.config->GetHomeParam(whole(a[0]), p); },
                 [&](auto* p) { return s.core.config->SetHomeParam(whole(a[0]), p); });
      }}},
    {"config.SetLimitParam",
     {2, 65536, [](Session& s, const List& a, List&) {
          return change<Config::LimitParam>(a[1],
                 [&](auto* p) { return s.core.config->GetLimitParam(whole(a[0]), p); },
                 [&](auto* p) { return s.core.config->SetLimitParam(whole(a[0]), p); });
      }}},
    {"config.SetMotionParam",
     {2, 65536, [](Session& s, const List& a, List&) {
          return change<Config::MotionParam>(a[1],
                 [&](auto* p) { return s.core.config->GetMotionParam(whole(a[0]), p); },
                 [&](auto* p) { return s.core.config->SetMotionParam(whole(a[0]), p); });
      }}},
    {"config.SetAlarmParam",
     {2, 65536, [](Session& s, const List& a, List&) {
          return change<Config::AlarmParam>(a[1],
                 [&](auto* p) { return s.core.config->GetAlarmParam(whole(a[0]), p); },
                 [&](auto* p) { return s.core.config->SetAlarmParam(whole(a[0]), p); });
      }}},
    {"config.GetEmergencyStopParam",
     {0, 1555, [](Session& s, const List&, List& out) {
          return answer<Config::EmergencyStopParam>(out, [&](auto*... p) { return s.core.config->GetEmergencyStopParam(p...); });
      }}},
    {"config.SetEmergencyStopParam",
     {1, 65536, [](Session& s, const List& a, List&) {
          return change<Config::EmergencyStopParam>(a[0],
                 [&](auto* p) { return s.core.config->GetEmergencyStopParam(p); },
                 [&](auto* p) { return s.core.config->SetEmergencyStopParam(p); });
      }}},
    {"config.GetAxisParam",
     {0, 1555, [](Session& s, const List&, List& out) {
          return answer<Config::AxisParam>(out, [&](auto*... p) { return s.core.config->GetAxisParam(p...); });
      }}},
    {"advMotion.CreateSplineBuffer",
     {2, 1552, [](Session& s, const List& a, List&) {
          return s.advanced.advMotion->CreateSplineBuffer(natural(a[0]), natural(a[1]));
      }}},
    {"advMotion.FreeSplineBuffer",
     {1, 1552, [](Session& s, const List& a, List&) {
          return s.advanced.advMotion->FreeSplineBuffer(natural(a[0]));
      }}},
    {"advMotion.GetSplineBufferPoints",
     {1, 1552, [](Session& s, const List& a, List& out) {
          return answer<unsigned>(out, [&](auto*... p) { return s.advanced.advMotion->GetSplineBufferPoints(natural(a[0]), p...); });
      }}},
    {"Io.SetOutBit",
     {3, 1555, [](Session& s, const List& a, List&) {
          return s.io.SetOutBit(whole(a[0]), whole(a[1]), narrow<unsigned char>(a[2]));
      }}},
};
