import { Box, Text } from "@mantine/core";
import type { Description } from "../../api/logAnalyses";
import { percentText, withUnit } from "../../ui/format";
import { LabelledValue } from "../../ui/LabelledValue";
import fleet from "../fleet/Fleet.module.css";
import { lengthText } from "./readings";

/** The whole flight as it was flown; what the log does not tell has no place. */
export function Flight({ description }: { description: Description }) {
  return (
    <Box component="dl" className={fleet["facts"]} my={14} aria-label="Whole flight">
      {readingsOf(description).map(({ title, value, detail }) => (
        <LabelledValue
          key={title}
          title={title}
          value={
            <>
              {value}{" "}
              {detail && (
                <Text component="small" display="block" c="dimmed" fz="small" fw={550}>
                  {detail}
                </Text>
              )}
            </>
          }
        />
      ))}
    </Box>
  );
}

interface Reading {
  title: string;
  value: string;
  detail?: string;
}

export function readingsOf(flight: Description): Reading[] {
  const { deviation_mean_m: mean, deviation_largest_m: largest, oscillation, hover_throttle: hover } = flight;
  return [
    {
      title: "In the air",
      value: withUnit(flight.flown_s, "s", 0),
      ...(flight.held_s > 0 && { detail: `${withUnit(flight.held_s, "s", 0)} with the altitude held` }),
    },
    ...known(hover, (value) => ({
      title: "Hover throttle",
      value: withUnit(value, "", 3),
      detail: `± ${withUnit(flight.hover_throttle_deviation, "", 3)}`,
    })),
    ...known(mean, (value) => ({
      title: "Mean deviation",
      value: lengthText(value),
      detail: `at most ${lengthText(largest ?? value)}`,
    })),
    ...known(flight.searched_s || null, () => ({
      title: "Oscillation",
      value: oscillation ? `±${lengthText(oscillation.amplitude_m)}` : "none",
      ...(oscillation && {
        detail: `${withUnit(oscillation.frequency_hz, "Hz", 2)}, since ${withUnit(oscillation.since_s, "s", 0)}`,
      }),
    })),
    ...known(flight.saturated_share || null, (share) => ({
      title: "Throttle at a limit",
      value: percentText(100 * share, share < 0.1 ? 1 : 0),
      detail: "of the time",
    })),
  ];
}

function known<T>(value: T | null, reading: (value: T) => Reading): Reading[] {
  return value === null ? [] : [reading(value)];
}
