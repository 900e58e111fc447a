/** Actions of the fly screen: stage, take off, unstage; land and motors off, which bypass the queue. */

import { useMutation } from "@tanstack/react-query";
import { useEffect, useRef, useState } from "react";
import { answer } from "./client";
import { landVehicle, stageTrial, stopMotors, type Trial, takeOffTrial, unstageTrial } from "./generated";
import { controlHeader } from "./leases";
import { problemOf } from "./problems";

type Act = typeof stageTrial | typeof takeOffTrial | typeof unstageTrial;

function useAct(act: Act, vehicleId: number) {
  return useMutation({
    mutationFn: ({ id }: Trial) => answer(act({ path: { trial_id: id }, headers: controlHeader(vehicleId) })),
    onSuccess: (after, _trial, _before, { client }) => client.setQueryData(["trial", after.id], after),
    onSettled: (_after, _error, { id, campaign_id }, _before, { client }) => {
      const stale = [["trial", id], ["campaign", campaign_id], ["vehicles"], ["flying"]];
      return Promise.all(stale.map((queryKey) => client.invalidateQueries({ queryKey })));
    },
  });
}

export function useFlyActions(vehicleId: number) {
  return {
    stage: useAct(stageTrial, vehicleId),
    takeOff: useAct(takeOffTrial, vehicleId),
    unstage: useAct(unstageTrial, vehicleId),
  };
}

export type VehicleCommand = "land" | "motors off";

export interface CommandAnswer {
  order: VehicleCommand;
  accepted: boolean;
  sentence: string;
}

const SENDS = { land: landVehicle, "motors off": stopMotors } as const;
const AGAIN_MS = 400;
/** A command must not be executed long after it was given. */
const GIVE_UP_MS = 5000;

async function send(vehicleId: number, order: VehicleCommand): Promise<CommandAnswer> {
  try {
    const { accepted, sentence } = await answer(SENDS[order]({ path: { vehicle_id: vehicleId }, body: {} }));
    return { order, accepted, sentence };
  } catch (error) {
    const problem = problemOf(error);
    return {
      order,
      accepted: false,
      sentence: problem === null ? "" : `${problem.title.replace(/\.$/, "")}. ${problem.detail} ${problem.hint}`,
    };
  }
}

/** Command a vehicle to land or to stop its motors; retried for five seconds until the worker accepts it. */
export function useVehicleCommands(vehicleId: number) {
  const [said, setSaid] = useState<CommandAnswer | null>(null);
  const again = useRef<ReturnType<typeof setTimeout> | undefined>(undefined);
  useEffect(() => () => clearTimeout(again.current), []);

  async function tell(order: VehicleCommand, untilMs: number): Promise<void> {
    const answered = await send(vehicleId, order);
    setSaid(answered);
    if (answered.accepted || performance.now() >= untilMs) return;
    again.current = setTimeout(() => void tell(order, untilMs), AGAIN_MS);
  }

  const press = (order: VehicleCommand): void => {
    clearTimeout(again.current);
    void tell(order, performance.now() + GIVE_UP_MS);
  };
  return { said, press };
}
