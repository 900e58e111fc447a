import { Button, Stack, TextInput } from "@mantine/core";
import { IconAlertTriangle } from "@tabler/icons-react";
import { useState } from "react";
import { useCreateTrial } from "../../api/mutations";
import { isGateRefusal, offersOf, problemOf, reasonsByField } from "../../api/problems";
import { useCatalogue } from "../../api/queries";
import type { Campaign } from "../../api/types";
import { gainText, readNumber, typed, typedGain } from "../../ui/format";
import { Note } from "../../ui/Note";
import { ErrorNotice } from "../../ui/Notices";
import { GateRefusal } from "./GateChecks";
import classes from "./NextFlight.module.css";
import type { Speed } from "./nextStep";

interface Props {
  campaign: Campaign;
  start: Record<string, number>;
  speed: Speed;
  onClose: () => void;
}

/** Manual gains, with the same checks as proposed ones. Only valid numbers can be flown. */
export function ManualGains({ campaign, start, speed, onClose }: Props) {
  const names = Object.keys(start);
  const [texts, setTexts] = useState(() =>
    Object.fromEntries(Object.entries(start).map(([name, value]) => [name, typedGain(value)])),
  );
  const create = useCreateTrial(campaign);
  const experiment = useCatalogue().data?.experiments.find(({ name }) => name === campaign.definition.experiment);
  const problem = problemOf(create.error);
  const refused = isGateRefusal(problem);
  const reasons = reasonsByField(problem, names);
  const readings = names.map((name) => ({ name, ...readNumber(texts[name] ?? "") }));
  const unread = readings.filter(({ reason }) => reason !== undefined).map(({ name }) => name);
  const gains = Object.fromEntries(
    readings.flatMap(({ name, value }) => (value === undefined ? [] : [[name, value] as const])),
  );
  const { can_fly, needs_staging } = campaign.vehicle;
  const flies = can_fly && !needs_staging;
  const act = flies ? "Fly" : "Plan";
  const change = (name: string, text: string): void => {
    setTexts({ ...texts, [name]: text });
    create.reset();
  };
  function submit(overrule?: string): void {
    if (unread.length > 0) return;
    create.mutate(
      {
        gains,
        ...(overrule === undefined ? {} : { overrule }),
        ...(flies ? { fly: { speed } } : {}),
      },
      { onSuccess: onClose },
    );
  }
  return (
    <form
      className={classes["stack"]}
      noValidate
      onSubmit={(event) => {
        event.preventDefault();
        submit();
      }}
    >
      {readings.map(({ name, reason }) => {
        const gain = experiment?.gains.find((one) => one.name === name);
        return (
          <TextInput
            key={name}
            label={`${name}${gain ? ` · ${gain.title}` : ""}`}
            description={gain && `${gainText(gain.lower)} … ${gainText(gain.upper)} ${gain.unit}`}
            inputMode={gain?.integer && gain.lower >= 0 ? "numeric" : "text"}
            autoComplete="off"
            value={texts[name] ?? ""}
            onChange={(event) => change(name, event.currentTarget.value)}
            error={reason ?? (reasons[name] === undefined ? undefined : refused ? "Refused, see below" : reasons[name])}
          />
        );
      })}
      {refused && problem !== null && (
        <GateRefusal
          problem={problem}
          offers={names.flatMap((name) => offersOf(problem).filter(([gain]) => gain === name))}
          onUse={(offers) => {
            setTexts({ ...texts, ...Object.fromEntries(offers.map(([name, value]) => [name, typed(value)])) });
            create.reset();
          }}
        />
      )}
      {refused && !campaign.vehicle.is_real && <Overrule pending={create.isPending} onFly={submit} />}
      <Note fz="body" className="numbers" aria-live="polite">
        {unread.length > 0
          ? `Enter a number for ${unread.join(", ")}.`
          : `${act === "Fly" ? "Flies" : "Plans"} ${Object.entries(gains)
              .map(([name, value]) => `${name} ${typed(value).replace("-", "−")}`)
              .join(" · ")}`}
      </Note>
      <Button type="submit" size="lg" disabled={unread.length > 0} loading={create.isPending}>
        {act} these gains
      </Button>
      <Button variant="default" onClick={onClose}>
        Back to the proposal
      </Button>
      {!refused && <ErrorNotice error={create.error} shown={names} />}
    </form>
  );
}

/** Simulations only: fly gains that the gate refuses, with a reason that is stored with the flight. */
function Overrule({ pending, onFly }: { pending: boolean; onFly: (reason: string) => void }) {
  const [reason, setReason] = useState("");
  return (
    <details className={classes["more"]}>
      <summary>Overrule the gate</summary>
      <Stack gap={14}>
        <Note fz="body">
          Refused gains can be flown on a simulated vehicle only. The reason is saved and shown with the flight.
        </Note>
        <TextInput
          label="Reason"
          placeholder="For example: the paper flew these gains"
          value={reason}
          maxLength={500}
          onChange={(event) => setReason(event.currentTarget.value)}
        />
        <Button
          color="red"
          variant="outline"
          leftSection={<IconAlertTriangle size={20} aria-hidden />}
          disabled={reason.trim() === ""}
          loading={pending}
          onClick={() => onFly(reason.trim())}
        >
          Fly refused gains
        </Button>
      </Stack>
    </details>
  );
}
