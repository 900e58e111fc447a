import { Button } from "@mantine/core";
import { IconPencil } from "@tabler/icons-react";
import { useStatistics } from "../../api/queries";
import { Note } from "../../ui/Note";
import classes from "./NextFlight.module.css";
import { type Choice, expectationOf, type Variant } from "./proposal";

interface Props {
  campaignId: number;
  choices: readonly Choice[];
  disabled: boolean;
  onFly: (variant: Variant) => void;
  onEdit: () => void;
}

/** Alternatives to the proposal, each with its expected error. */
export function FlightAlternatives({ campaignId, choices, disabled, onFly, onEdit }: Props) {
  return (
    <div className={classes["row"]}>
      {choices.map(({ variant, label, hint }) => (
        <div key={variant}>
          <Button fullWidth variant="default" title={hint} disabled={disabled} onClick={() => onFly(variant)}>
            {label}
          </Button>
          <Expectation campaignId={campaignId} variant={variant} />
        </div>
      ))}
      <Button variant="default" leftSection={<IconPencil size={18} aria-hidden />} onClick={onEdit}>
        Edit gains
      </Button>
    </div>
  );
}

/** One line below the button that flies the variant. */
export function Expectation({ campaignId, variant }: { campaignId: number; variant: Variant }) {
  const expectation = expectationOf(variant, useStatistics(campaignId).data);
  return expectation === "" ? null : (
    <Note fz="fine" lh={1.35} m="6px 2px 4px" className="numbers">
      {expectation}
    </Note>
  );
}
