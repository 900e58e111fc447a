import { MantineProvider } from "@mantine/core";
import { act } from "react";
import { createRoot } from "react-dom/client";
import { expect, test, vi } from "vitest";
import { VehiclesInLog } from "./VehiclesInLog";

test("all vehicles of a log are listed in order of their ids, and another one can be chosen", async () => {
  vi.stubGlobal("IS_REACT_ACT_ENVIRONMENT", true);
  const page = document.createElement("div");
  const onVehicle = vi.fn();
  await act(() =>
    createRoot(page).render(
      <MantineProvider defaultColorScheme="light">
        <VehiclesInLog vehicles={{ 31: "Paparazzi", 2: "ArduCopter" }} analysed={31} onVehicle={onVehicle} />
      </MantineProvider>,
    ),
  );
  const choices = [...page.querySelectorAll<HTMLInputElement>("input[type=radio]")];
  expect([...page.querySelectorAll("label")].map(({ textContent }) => textContent)).toEqual([
    "System 2, ArduCopter",
    "System 31, Paparazzi",
  ]);
  expect(choices.map(({ checked }) => checked)).toEqual([false, true]);
  await act(() => choices[0]?.click());
  expect(onVehicle.mock.calls).toEqual([[2]]);
});
