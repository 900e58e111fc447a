import { Button, TextInput } from "@mantine/core";
import { IconPlus } from "@tabler/icons-react";
import { useEffect, useState } from "react";
import { useNavigate, useSearchParams } from "react-router";
import { useCreateCampaign } from "../../api/mutations";
import { reasonsByField, standingProblem } from "../../api/problems";
import { useCatalogue } from "../../api/queries";
import type { Catalogue, Vehicle } from "../../api/types";
import { useVehicles } from "../../api/vehicles";
import { Aside } from "../../ui/Aside";
import { SelectField } from "../../ui/Fields";
import classes from "../../ui/Form.module.css";
import { FoldedSection, FormPage, GainFields, MissingEntries } from "../../ui/FormPage";
import { FormErrorNotice } from "../../ui/Notices";
import { offeredExperiments } from "../../ui/units";
import { useTitle } from "../../ui/useTitle";
import { AdvancedFields } from "./AdvancedFields";
import { DonorPicker } from "./DonorPicker";
import {
  advancedTitle,
  type CampaignForm,
  fieldsOf,
  flyingOther,
  gainsOf,
  inUnitsOfForm,
  kindsFor,
  LABELS,
  presetOf,
  registeredFor,
  requestFrom,
  type StartKind,
  startingForm,
  startsFor,
  strategiesFor,
  unreadable,
  withExperiment,
  withPreset,
  withRegistered,
  withVehicle,
} from "./newCampaign";
import { VehiclePicker } from "./VehiclePicker";

/** `?vehicle=ID` preselects a registered vehicle. */
export function NewCampaignPage() {
  useTitle("New campaign");
  const catalogue = useCatalogue();
  const vehicles = useVehicles();
  const wanted = Number(useSearchParams()[0].get("vehicle"));

  return (
    <FormPage
      title="New campaign"
      error={catalogue.error ?? vehicles.error}
      isPending={catalogue.isPending || vehicles.isPending}
    >
      {catalogue.data && vehicles.data && (
        <NewCampaignForm
          catalogue={catalogue.data}
          vehicles={vehicles.data}
          wanted={vehicles.data.find(({ id, registered }) => registered && id === wanted)}
        />
      )}
    </FormPage>
  );
}

const ENTER_NAME = "Enter a name.";
const CHOOSE_VEHICLE = "Choose a vehicle.";
const CHOOSE_CAMPAIGN = "Choose a campaign.";
const NO_PRESET = { value: "", label: "Own settings" };

const STARTS: Record<StartKind, string> = {
  default: "The vehicle's default gains",
  simplex: "Best gains on the model (simplex)",
  campaign: "Best gains of another campaign",
  given: "Custom gains",
};

interface FormProps {
  catalogue: Catalogue;
  vehicles: readonly Vehicle[];
  wanted: Vehicle | undefined;
}

function NewCampaignForm({ catalogue, vehicles, wanted }: FormProps) {
  const [form, setForm] = useState<CampaignForm>(() => {
    const start = startingForm(catalogue);
    return wanted === undefined ? start : withRegistered(start, catalogue, wanted);
  });
  const navigate = useNavigate();
  const create = useCreateCampaign();
  const { plain, advanced } = fieldsOf(form, catalogue);
  const labels = { ...plain, ...advanced };
  const request = requestFrom(form, catalogue);
  const problem = standingProblem(create.error, create.variables, request);
  const reasons = inUnitsOfForm(reasonsByField(problem, Object.keys(labels)));
  useEffect(() => {
    if (create.error) document.querySelector<HTMLElement>('main [aria-invalid="true"]')?.focus();
  }, [create.error]);

  const refusedBelow = Object.keys(advanced).some((field) => reasons[field] !== undefined);
  const set = (change: Partial<CampaignForm>): void => setForm({ ...form, ...change });
  const preset = presetOf(form, catalogue);
  const presets = catalogue.presets.map(({ name, title }) => ({ value: name, label: title }));
  const strategies = strategiesFor(catalogue, form.experiment);
  const strategy = strategies.find(({ name }) => name === form.strategy);
  const recommended = strategies[0]?.name;
  const unread = unreadable(form, catalogue);
  const isNamed = form.name.trim() !== "";
  const lacksDonor = form.start === "campaign" && form.donor === null;
  const lacksVehicle = form.vehicle === "";
  const missing = [
    ...(isNamed ? [] : [ENTER_NAME]),
    ...(lacksVehicle ? [CHOOSE_VEHICLE] : []),
    ...(lacksDonor ? [CHOOSE_CAMPAIGN] : []),
  ];
  const isUnreadBelow = unread.some((label) => !(label in form.startGains));
  const isReal = vehicles.some(({ id, is_real }) => id === form.registered?.id && is_real);
  return (
    <form
      noValidate
      className={classes["form"]}
      onSubmit={(event) => {
        event.preventDefault();
        create.mutate(request, { onSuccess: ({ id }) => void navigate(`/campaigns/${id}`) });
      }}
    >
      <SelectField
        label="Preset"
        description={preset?.line}
        data={preset === undefined ? [NO_PRESET, ...presets] : presets}
        value={preset?.name ?? NO_PRESET.value}
        onChange={(value) => {
          const chosen = catalogue.presets.find(({ name }) => name === value);
          if (chosen !== undefined) setForm(withPreset(form, catalogue, chosen));
        }}
      />
      {catalogue.experiments.length > 1 && (
        <SelectField
          label={LABELS["definition.experiment"]}
          data={offeredExperiments(catalogue).map(({ name, title }) => ({ value: name, label: title }))}
          value={form.experiment}
          error={reasons["definition.experiment"]}
          onChange={(value) => setForm(withExperiment(form, catalogue, value))}
        />
      )}
      <VehiclePicker
        kinds={kindsFor(catalogue, form.experiment)}
        registered={registeredFor(vehicles, form.experiment)}
        others={flyingOther(vehicles, form.experiment)}
        kind={form.vehicle}
        vehicleId={form.registered?.id ?? null}
        error={lacksVehicle ? CHOOSE_VEHICLE : (reasons["vehicle.kind"] ?? reasons["vehicle.id"])}
        onKind={(kind) => setForm(withVehicle(form, catalogue, kind))}
        onVehicle={(vehicle) => setForm(withRegistered(form, catalogue, vehicle))}
      />
      {isReal && (
        <Aside tone="warn">
          {form.registered?.name} is a real vehicle. Before its first flight, the campaign must pass a rehearsal on a
          simulation, which you start from the campaign page.
        </Aside>
      )}
      <TextInput
        label={LABELS.name}
        value={form.name}
        maxLength={120}
        error={isNamed ? reasons["name"] : ENTER_NAME}
        onChange={(event) => set({ name: event.currentTarget.value })}
      />
      <div className={classes["pair"]}>
        <SelectField
          label={LABELS["start.kind"]}
          data={startsFor(catalogue, form.experiment).map((value) => ({ value, label: STARTS[value] }))}
          value={form.start}
          error={reasons["start.kind"]}
          onChange={(value) => set({ start: value })}
        />
        <SelectField
          label={LABELS.strategy}
          description={`${strategies.length > 1 && form.strategy === recommended ? "Recommended. " : ""}${strategy?.line ?? ""}`}
          data={strategies.map(({ name, title }) => ({ value: name, label: title }))}
          value={form.strategy}
          error={reasons["strategy"]}
          onChange={(value) => set({ strategy: value, strategyOptions: {} })}
        />
      </div>
      {form.start === "campaign" && (
        <DonorPicker
          experiment={form.experiment}
          donor={form.donor}
          error={lacksDonor ? CHOOSE_CAMPAIGN : reasons["start.donor"]}
          onChange={(donor) => set({ donor })}
        />
      )}
      {form.start === "given" && (
        <GainFields
          legend="Start gains"
          gains={gainsOf(catalogue, form.experiment)}
          values={form.startGains}
          reasons={reasons}
          prefix="start.gains"
          onChange={(startGains) => set({ startGains })}
        />
      )}
      <FoldedSection title={advancedTitle(form, catalogue)} forcedOpen={refusedBelow || isUnreadBelow}>
        <AdvancedFields form={form} catalogue={catalogue} reasons={reasons} set={set} />
      </FoldedSection>
      <FormErrorNotice error={problem} labels={labels} />
      <div className={classes["create"]}>
        <MissingEntries numbers={unread} texts={missing} />
        <Button
          type="submit"
          size="lg"
          disabled={unread.length > 0 || missing.length > 0}
          loading={create.isPending}
          leftSection={<IconPlus size={22} aria-hidden />}
        >
          Create campaign
        </Button>
      </div>
    </form>
  );
}
